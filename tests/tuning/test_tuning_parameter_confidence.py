"""What a fit is worth: covariance, what the data cannot tell, faults by their pulls."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from small_machine import virtual_campaign

from identification.words import Campaign, Condition, Dof, Frf, FrfEstimate, Test
from mbmodel import Evaluator, FrfRequest, Model, as_drawn, body_parts, load_machine, spring_parts
from tuning import (
    estimate_confidence,
    fit,
    parametrise,
    predict,
)
from tuning.assessment.frf_bands import frf_deviations, magnitude_deviations
from tuning.assessment.parameter_confidence import (
    ParameterConfidence,
    bound_covariance,
    rank_pulls,
)
from tuning.misfit.batch import batch_tests
from tuning.misfit.weights import FORCE_ERROR_FLOOR

FREQ = np.linspace(3.0, 90.0, 120)
SIDE_BY_SIDE = (
    '<body name="a"><inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/><joint name="a_tx" '
    'type="slide" axis="1 0 0" stiffness="2e5" damping="90"/><site name="acc1"/></body>',
    '<tendon><fixed name="leg" stiffness="3e5"><joint joint="a_tx" coef="1"/></fixed></tendon>',
)


def at(path, body, springs=""):
    path.write_text(
        f'<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>{body}'
        f"</worldbody>{springs}</mujoco>",
        encoding="utf-8",
    )
    return as_drawn(load_machine(path))


def one_test_of(model, theta, outputs, reference) -> Campaign:
    """One virtual test with 1 % noise."""
    random = np.random.default_rng(3)
    dofs = tuple(Dof.parse(name) for name in outputs)
    asked = FrfRequest(FREQ, dofs, (Dof.parse(reference),))
    values = Evaluator(model, asked).at(theta).values
    sigma = np.broadcast_to(0.01 * np.sqrt((np.abs(values) ** 2).mean(axis=0)), values.shape)
    error = random.normal(size=(2, *values.shape)) * sigma / np.sqrt(2)
    frf = Frf(FREQ, values + error[0] + 1j * error[1], dofs, asked.inputs, "accelerance")
    estimate = FrfEstimate(frf, sigma**2, "differences", np.ones(values.shape[1:], bool))
    return Campaign(
        "one", model.machine.layout, (Test(Condition("t", Dof.parse(reference)), estimate),)
    )


def fit_with_confidence(model, campaign):
    result = fit(model, campaign)
    return result, estimate_confidence(model, campaign, result)


def test_one_spring_has_the_deviation_of_closed_form(tmp_path):
    # H = -w^2 / (k - m w^2 + i w c): dH / d log k = -k H / (k - m w^2 + i w c).
    model = at(
        tmp_path / "one.xml",
        '<body name="a"><inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/><joint name="a_tx" '
        'type="slide" axis="1 0 0" stiffness="2e5" damping="90"/><site name="acc1"/></body>',
    )
    campaign = one_test_of(model, model.drawn, ["acc1:+tx"], "acc1:+tx")
    result, confidence = fit_with_confidence(model, campaign)
    stiffness, damping = result.theta
    omega = 2 * np.pi * FREQ
    impedance = stiffness - 5 * omega**2 + 1j * omega * damping
    response = -(omega**2) / impedance
    slopes = np.array(
        [-response / impedance * stiffness, -response / impedance * 1j * omega * damping]
    )
    size = np.abs(campaign.tests[0].estimate.frf.values[:, 0, 0])
    weight = 1 / (campaign.tests[0].estimate.variance[:, 0, 0] + (FORCE_ERROR_FLOOR * size) ** 2)
    information = 2 * ((slopes.conj() * weight) @ slopes.T).real + np.diag(np.log([3.0, 4.0]) ** -2)
    expected = np.sqrt(np.diag(np.linalg.inv(information)) * confidence.variance_inflation)
    assert confidence.deviation == pytest.approx(expected, rel=1e-3)
    low, high = confidence.interval()
    assert (low < model.drawn).all()
    assert (model.drawn < high).all()


def test_a_joint_that_the_data_cannot_see_is_said_and_has_no_narrow_interval(tmp_path):
    model = at(
        tmp_path / "two.xml",
        '<body name="a"><inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/><joint name="a_tx" '
        'type="slide" axis="1 0 0" stiffness="2e5" damping="90"/><joint name="a_ty" type="slide" '
        'axis="0 1 0" stiffness="3e5" damping="80"/><site name="acc1"/></body>',
    )
    _, confidence = fit_with_confidence(
        model, one_test_of(model, model.drawn, ["acc1:+tx"], "acc1:+tx")
    )
    unseen = {
        name
        for direction in confidence.unidentifiable_directions()
        for name in direction.parameters
    }
    assert unseen == {"a_ty.stiffness", "a_ty.damping"}
    assert confidence.unidentifiable.tolist() == [False, False, True, True]
    low, high = confidence.interval()
    # The posterior is the prior: the drawing, and factors of 3 and 4 as one standard deviation.
    expected = model.drawn[2:] * np.array([[3.0, 4.0]]) ** np.array([[-1.959964], [1.959964]])
    np.testing.assert_allclose([low[2:], high[2:]], expected, rtol=1e-6)
    assert (high[:2] / low[:2] < 2).all()
    assert any(
        direction.sentence == "a_ty.stiffness is not determined by the data"
        for direction in confidence.unidentifiable_directions()
    )


def test_two_springs_side_by_side_are_seen_only_as_a_sum(tmp_path):
    model = at(tmp_path / "beside.xml", *SIDE_BY_SIDE)
    _, confidence = fit_with_confidence(
        model, one_test_of(model, model.drawn, ["acc1:+tx"], "acc1:+tx")
    )
    names = ["a_tx.stiffness", "leg.stiffness"]
    directions = confidence.unidentifiable_directions()
    (direction,) = (d for d in directions if sorted(d.parameters) == names)
    assert direction.sentence.endswith("are determined only as a sum")


def test_two_springs_in_a_row_are_seen_only_as_a_sum_of_compliances(tmp_path):
    model = at(
        tmp_path / "row.xml",
        '<body name="plate"><inertial pos="0 0 0" mass="1e-6" diaginertia="1 1 1"/><joint '
        'name="plate_tx" type="slide" axis="1 0 0" stiffness="2e5"/><body name="a"><inertial '
        'pos="0 0 0" mass="5" diaginertia="1 1 1"/><joint name="a_tx" type="slide" axis="1 0 0" '
        'stiffness="3e5"/><joint name="a_ty" type="slide" axis="0 1 0" stiffness="1e5" '
        'damping="70"/><site name="acc1"/></body></body>',
    )
    campaign = one_test_of(model, model.drawn, ["acc1:+tx", "acc1:+ty"], "acc1:+tx")
    _, confidence = fit_with_confidence(model, campaign)
    words = [
        direction.sentence
        for direction in confidence.unidentifiable_directions()
        if "compliances" in direction.sentence
    ]
    assert len(words) == 1
    assert "plate_tx.stiffness" in words[0]
    assert "a_tx.stiffness" in words[0]


def test_a_mass_drawn_a_fifth_too_small_is_called_out_by_its_pull(model, true_theta):
    campaign = virtual_campaign(model, true_theta)
    machine = model.machine
    wrong = machine.body_mass.copy()
    head = slice(6, 12)
    wrong[head, head] /= 1.2
    drawn = replace(machine, body_mass=wrong)
    tuned = Model(drawn, (*spring_parts(drawn), *body_parts(drawn)))
    parametrisation = parametrise(tuned, campaign.tolerance).lift_bounds()
    result = fit(tuned, campaign, parametrisation=parametrisation)
    name, pull = rank_pulls(parametrisation, result.x)[0]
    assert name == "head.mass"
    assert pull > 6  # ln 1.2 / 0.02 is 9; the moments of inertia take a part


def test_deviations_are_those_of_the_dense_covariance(whole, parametrisation, off, mixed):
    result = replace(fit(whole, mixed, parametrisation=parametrisation, stages=()), x=off)
    confidence = estimate_confidence(whole, mixed, result)
    lines = batch_tests(whole, mixed.select_lines(slice(4, 9)))[0].evaluator.at(
        parametrisation.theta(off)
    )
    columns = (
        lines.sensitivities(parametrisation.free).columns()
        * parametrisation.rates(off)[parametrisation.free]
    )
    units = [np.full(lines.values.shape, unit) for unit in (1.0 + 0j, 1j, np.exp(0.7j))]
    for unit, actual in zip(units, frf_deviations(lines, confidence, units), strict=True):
        slopes = (unit.conj()[..., None] * columns).real
        dense = np.sqrt(np.einsum("fomi,ij,fomj->fom", slopes, confidence.covariance, slopes))
        assert actual == pytest.approx(dense, rel=1e-9)


def test_the_magnitude_of_a_prediction_scatters_as_its_band_says(model, true_theta, campaign):
    result, confidence = fit_with_confidence(model, campaign)
    random = np.random.default_rng(8)
    root = np.linalg.cholesky(confidence.covariance)
    drawn = [
        result.parametrisation.theta(result.x + root @ random.normal(size=len(root)))
        for _ in range(300)
    ]
    spread = np.std([np.abs(predict(model, theta, campaign)[0]) for theta in drawn], axis=0)
    band = magnitude_deviations(model, confidence, campaign)[0]
    moving = band > 1e-6 * band.max()
    ratio = spread[moving] / band[moving]
    assert np.median(ratio) == pytest.approx(1.0, abs=0.05)
    assert np.quantile(ratio, [0.05, 0.95]) == pytest.approx([1.0, 1.0], abs=0.2)
    assert true_theta.shape == result.theta.shape


def directions_of(information, sizes):
    """Directions of parameters without priors, from the normal equations of the data."""
    count = len(sizes)
    parametrisation = SimpleNamespace(
        is_logarithmic=np.ones(count, bool),
        is_tolerance=np.zeros(count, bool),
        precision=np.zeros(count),
        names=[f"k{number}" for number in range(count)],
        coordinate_of=np.arange(count),
        theta=lambda _: np.asarray(sizes, float),
    )
    normal = SimpleNamespace(dense=lambda: np.asarray(information, float))
    confidence = ParameterConfidence(parametrisation, np.zeros(count), normal, 1.0)
    return {row.sentence for row in confidence.unidentifiable_directions()}


def test_of_one_pair_a_product_and_a_ratio_are_not_said_at_once():
    pair = np.array([[1.0, 1.0], [1.0, 1.0]])
    assert directions_of(1e4 * pair, (1e6, 3e3)) == {"k0 and k1 are determined only as a product"}
    zero = directions_of(1e4 * pair, (0.0, 3e3))  # a size that varies linearly, and is none
    assert zero == {"k0 and k1 are determined in combination only"}
    neither = {"k0 is not determined by the data", "k1 is not determined by the data"}
    assert directions_of(0.1 * pair, (1e6, 3e3)) == neither


def test_a_parameter_alone_is_kept_apart_from_a_combination():
    rows = np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])  # k0 + k1 well seen, k2 hardly
    seen = rows.T @ np.diag([1e4, 0.01]) @ rows
    assert directions_of(seen, (1e6, 3e3, 5e2)) == {
        "k0 and k1 are determined only as a product", "k2 is not determined by the data",
    }  # fmt: skip
    together = 1e4 * np.ones((3, 3))
    (sentence,) = directions_of(together, (1e6, 3e3, 5e2))
    assert sentence.endswith("are determined in combination only")


def test_neighbouring_lines_that_share_an_error_determine_less(tmp_path):
    # The standard deviation of many fits is that of smooth errors, not of as many independent ones.
    model = at(
        tmp_path / "one.xml",
        '<body name="a"><inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/><joint name="a_tx" '
        'type="slide" axis="1 0 0" stiffness="2e5" damping="1900"/><site name="acc1"/></body>',
    )
    random = np.random.default_rng(8)
    centres = np.linspace(FREQ[0], FREQ[-1], 60)
    shapes = np.exp(-(((FREQ[:, None] - centres) / 1.5) ** 2))
    ends, stated, independent = [], [], []
    for _ in range(40):
        campaign = one_test_of(model, model.drawn, ["acc1:+tx"], "acc1:+tx")
        (test,) = campaign.tests
        relative = shapes @ (random.normal(size=(60, 2)) @ [0.1, 0.1j])
        frf = test.estimate.frf
        off = replace(frf, values=frf.values * (1 + relative)[:, None, None])
        test = replace(test, estimate=replace(test.estimate, frf=off))
        result, confidence = fit_with_confidence(model, replace(campaign, tests=(test,)))
        ends.append(np.log(result.theta / model.drawn))
        stated.append(confidence.deviation)
        independent.append(replace(confidence, band_shifts=None).deviation)
    observed = np.std(ends, axis=0)
    assert (np.mean(independent, axis=0) < 0.6 * observed).all()
    np.testing.assert_allclose(np.mean(stated, axis=0), observed, rtol=0.35)


def test_steps_without_a_band_leave_no_interval_beyond_the_bounds(tmp_path):
    model = at(tmp_path / "beside.xml", *SIDE_BY_SIDE)
    campaign = one_test_of(model, model.drawn, ["acc1:+tx"], "acc1:+tx")
    _, confidence = fit_with_confidence(model, campaign)
    seen = np.linalg.eigh(confidence.covariance)[1]  # from the most certain direction
    shifts = np.outer([300.0, -100.0, 50.0, -250.0], seen[:, -1])  # e^300: no stiffness
    bounded = replace(confidence, band_shifts=shifts)
    assert (bounded.deviation <= confidence.prior_precision**-0.5 * (1 + 1e-9)).all()
    most = seen[:, 0]
    before = most @ replace(confidence, band_shifts=None).covariance @ most
    assert most @ bounded.covariance @ most == pytest.approx(before, rel=0.01)


def test_no_direction_is_wider_than_the_prior():
    random = np.random.default_rng(8)
    root = random.normal(size=(5, 5))
    covariance, limits = root @ root.T, np.array([1.0, 1e8, 0.3, 1e8, 20.0])
    bounded = bound_covariance(covariance, limits)
    excess = np.linalg.eigvalsh(np.diag(limits) - bounded)
    assert excess.min() > -1e-9 * limits.max()
    np.testing.assert_allclose(bound_covariance(covariance, 1e6 * np.ones(5)), covariance)
    units = np.diag([1e6, 1.0, 1e-4, 1e3, 1.0])  # of coordinates: the result has them too
    scaled = bound_covariance(units @ covariance @ units, limits * np.diag(units) ** 2)
    np.testing.assert_allclose(scaled, units @ bounded @ units, rtol=1e-6)
