"""Verdicts of linearised draws: against least squares written out, and against the posterior."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.stats import binom, norm

from diagnosis.inference.calibration import load_calibration
from diagnosis.inference.evidence import Evidence, FittedSet
from diagnosis.inference.posterior import compute_posterior
from tests.helpers.linearised import stack_jacobian
from truth import Protocol, Tolerances, Weighing, find_signatures, linearise_test
from truth.campaign.bounded_least_squares import BOUND
from truth.campaign.held_tolerances import hold_tolerances
from truth.campaign.linear_verdicts import LinearVerdicts
from truth.campaign.signatures import Information
from truth.effects import CATALOGUE
from truth.machine.random_tree import draw_tree

NAMES = ("mass_error", "structural_damping", "sensor_gain", "sensor_position")
CONSTANTS = load_calibration()


@pytest.fixture(scope="module")
def test():
    tree = draw_tree(12, 2)
    protocol = Protocol((tree.first_aim(),), lines=161, resolution_hz=1.0)
    return linearise_test(tree, protocol, Tolerances()).thin(2)


@pytest.fixture(scope="module")
def verdicts(test):
    signatures, information = find_signatures(test, {name: CATALOGUE[name] for name in NAMES}, [])
    weighing = Weighing(
        values=2.0 * test.values,
        fitted_values=float(test.values),
        counted_values=2.0 * test.values,
        error_values=CONSTANTS.error_values,
        noise_exponent=CONSTANTS.noise_exponent,
        max_noise_share=CONSTANTS.max_noise_share,
        hidden=CONSTANTS.hidden["lines"],
        hidden_width=CONSTANTS.hidden_width,
        min_closed=0.2,
        outlier=4.5,
    )
    return LinearVerdicts(signatures, information, weighing, draws=60)


def numbers_of(verdicts, effect):
    return next(row for family, row in verdicts.families if family[0] == effect)


def test_the_shifts_have_the_covariance_of_a_fit_with_priors(verdicts):
    """The shifts xi = N^-1 (J^T J x_0 + J^T n), with x_0 of N(0, 1) and n of variance 1/2."""
    jacobian = np.random.default_rng(0).standard_normal((30, 9)) * np.geomspace(0.1, 10, 9)
    bounded = np.arange(9) % 4 != 3
    prior, data = np.diag(bounded.astype(float)), jacobian.T @ jacobian
    information = Information(data + prior / 2, bounded)
    inverse = np.linalg.inv(information.normal)
    exact = inverse @ (data @ prior @ data + data / 2) @ inverse
    few = LinearVerdicts([], information, verdicts.weighing, draws=40_000)
    stated = np.eye(int(bounded.sum())) - few.covariance / 2
    np.testing.assert_allclose(stated, exact[np.ix_(bounded, bounded)], atol=1e-9)
    np.testing.assert_allclose(np.cov(few.shifts.T), stated, atol=0.03)


def held_cost(normal, bounded, x):
    """Rise of the cost where tolerances are kept within their bounds, by another algorithm."""
    scale = np.sqrt(np.diag(normal))
    root = np.linalg.cholesky(normal / np.outer(scale, scale)).T
    limit = np.where(bounded, BOUND, np.inf) * scale
    fit = lsq_linear(root, root @ (x * scale), (-limit, limit), method="bvls", tol=1e-14)
    return 2 * fit.cost, fit.x / scale


def test_held_tolerances_cost_what_bounded_least_squares_says(verdicts):
    information = verdicts.information
    full = np.linalg.inv(information.normal)
    tolerances = np.flatnonzero(information.bounded)
    single = 0
    for number in range(12):
        # One tolerance is moved far off, and the others as a fit moves them with it.
        far = tolerances[7 * number]
        x = (3.0 + number) * full[:, far] / full[far, far]
        cost, worst = hold_tolerances(x[None, tolerances], verdicts.covariance)
        exact, held = held_cost(information.normal, information.bounded, x)
        assert cost[0] == pytest.approx(exact, rel=0.05)
        if (np.abs(held[information.bounded]) >= BOUND * (1 - 1e-9)).sum() == 1:
            assert cost[0] == pytest.approx(exact, rel=1e-4)
            assert abs(held[tolerances[worst[0]]]) == pytest.approx(BOUND)
            single += 1
    assert 2 <= single < 12


def squared_residual(matrix, goal):
    """Return the squared residual of a change that least squares fit."""
    scale = np.linalg.norm(matrix, axis=0)
    scale[scale == 0] = 1.0
    residual = goal - matrix / scale @ np.linalg.lstsq(matrix / scale, goal, rcond=1e-13)[0]
    return float(residual @ residual)


def test_a_rival_gains_what_least_squares_with_a_tolerance_held_say(test, verdicts):
    jacobian = stack_jacobian(test)
    numbers = numbers_of(verdicts, "sensor_position")[:1]
    worst = int(np.abs(verdicts.followed[numbers[0]]).argmax())
    shares = verdicts._rival_shares(numbers, np.full(verdicts.draws, worst))[0]
    held = np.flatnonzero(test.refit.bounded)[worst]
    zeros = np.zeros(jacobian.shape[1])
    goal = np.append(verdicts.signatures[numbers[0]].change, zeros)
    site = verdicts.signatures[numbers[0]].family[:2]
    rivals = [row for family, row in verdicts.families if family[:2] != site]
    for share, row in list(zip(shares, rivals, strict=True))[::9]:
        columns = [np.append(verdicts.signatures[k].change, zeros) for k in row]
        exact = []
        for matrix in (jacobian, np.delete(jacobian, held, axis=1)):
            before = squared_residual(matrix, goal)
            exact.append(1 - squared_residual(np.column_stack([matrix, *columns]), goal) / before)
        assert share == pytest.approx(max(exact), abs=2e-3)


def test_several_outliers_are_chance_by_the_binomial_probability(verdicts):
    limits = verdicts.limits
    count, least = len(verdicts.covariance), binom.sf(0, len(verdicts.covariance), 2 * norm.sf(4.5))
    assert limits[0] == pytest.approx(4.5)
    for number, limit in enumerate(limits):
        assert binom.sf(number, count, 2 * norm.sf(limit)) == pytest.approx(least, rel=1e-6)
    shift = np.zeros((3, count))
    shift[0, :2] = limits[1] * 1.01  # two that are improbable together
    shift[1, 0] = 4.4
    shift[2, 0] = 4.6
    assert verdicts._is_chance(shift).tolist() == [False, True, False]


def simulate(verdicts, numbers, size, draws, random):
    """Return the rate at which an effect is found, by least squares and posterior of each draw."""
    information, weighing = verdicts.information, verdicts.weighing
    normal, bounded = information.normal, information.bounded
    data = normal - np.diag(bounded / 2.0)
    scale = np.sqrt(np.diag(normal))
    root = np.linalg.cholesky(data / np.outer(scale, scale) + 1e-12 * np.eye(len(data)))
    limits = verdicts.limits
    is_named = []
    for draw in range(draws):
        signature = verdicts.signatures[numbers[draw % len(numbers)]]
        right = data @ (random.standard_normal(len(data)) * bounded)
        right += scale * (root @ random.standard_normal(len(data))) / np.sqrt(2)
        power = float(signature.left @ signature.left)
        along = size + random.standard_normal() / np.sqrt(2 * power)
        # The effect changes the normal equations by N f, and leaves e beside them.
        free = np.linalg.solve(normal, right)
        null = free + size * signature.followed
        true = null - along * signature.followed
        order = -np.sort(-np.abs(null[bounded]))[: len(limits)]
        is_chance = (order <= limits).all()
        costs = [0.0 if is_chance else held_cost(normal, bounded, x)[0] for x in (null, true)]
        after = costs[1] / weighing.fitted_values
        before = after + max(power * along**2 + costs[0] - costs[1], 0.0) / weighing.fitted_values
        noise = random.standard_normal() / np.sqrt(weighing.values)
        fits = [
            FittedSet(
                keys=keys, floor=0.01, cost=float(np.log1p(gap)), fitted_values=1,
                values=round(weighing.counted_values),
                noise_share=min(1 / (1 + after), weighing.max_noise_share),
                effective_values=1.0, chi_square=1 + gap, serial=gap + noise, doubt=1e9,
                parameters=(len(numbers),) * len(keys),
            )
            for keys, gap in (((), before), ((("true", "here", None),), after))
        ]  # fmt: skip
        evidence = Evidence(
            null=fits[0], sets=(fits[1],), variance="coherence",
            hypotheses=len({family[:2] for family, _ in verdicts.families}),
        )  # fmt: skip
        causes = compute_posterior(evidence, CONSTANTS).causes
        is_named.append(bool(causes) and causes[0][1] >= 0.5)
    return float(np.mean(is_named))


@pytest.mark.parametrize("effect", ["mass_error", "structural_damping"])
def test_rates_are_those_of_fits_weighed_by_the_posterior(verdicts, effect):
    """Each draw fitted by bounded least squares, at sizes that some and most draws show."""
    numbers = numbers_of(verdicts, effect)
    alone = [k for k, one in enumerate(verdicts.signatures) if one.effect != effect or k in numbers]
    many = replace(verdicts, draws=240)
    many = replace(many, signatures=[verdicts.signatures[k] for k in alone], _family_fits={})
    numbers = numbers_of(many, effect)
    many.__dict__["_is_rival"] = lambda *_: False
    sizes = np.geomspace(*many.signatures[numbers[0]].drawn.limits, 60)
    rates = np.array([many.find(numbers, np.full(many.draws, size)).mean() for size in sizes])
    random = np.random.default_rng(3)
    for wanted in (0.3, 0.85):
        number = int(np.abs(rates - wanted).argmin())
        exact = simulate(many, numbers, sizes[number], 120, random)
        assert exact == pytest.approx(rates[number], abs=0.15)
