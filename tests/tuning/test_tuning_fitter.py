"""Fits recover what made the data, from any start, and say how they ended."""

from dataclasses import replace

import numpy as np
import pytest
from small_machine import TOLERANCE, virtual_campaign

from identification.words import UsageError
from mbmodel import as_drawn
from tuning import (
    GAUSS_NEWTON,
    STAGES,
    TUNING_ALGORITHM,
    Misfit,
    Stage,
    build_toleranced_model,
    fit,
    parametrise,
    random_starts,
)
from tuning.fitting import stage_search
from tuning.fitting.checkpoint import Checkpoint
from tuning.fitting.stage_search import thin_lines

OPENING = STAGES[:2]


@pytest.fixture(scope="module")
def fitted(model, campaign):
    return fit(model, campaign)


@pytest.fixture(scope="module")
def misfit(model, campaign):
    """The misfit of theta by noise alone, relative to the number of values."""
    parametrisation = parametrise(model, campaign.tolerance)
    cost = Misfit(model, campaign, parametrisation, model_error_floor=0.0)
    return lambda theta: cost.value(parametrisation.coordinates(theta)) / cost.values


def test_the_fit_recovers_the_parameters_that_made_the_data(fitted, true_theta):
    # 1 % noise on 160 lines of some 20 channels: most parameters to a part in a thousand; the
    # least visible damping to a few per cent.
    error = np.abs(np.log(fitted.theta / true_theta))
    assert np.median(error) < 0.005
    assert error.max() < 0.1
    assert fitted.converged
    assert not fitted.at_bound.any()


def test_the_last_cost_is_that_of_noise_alone(fitted, true_theta, misfit, model, campaign):
    # Of 7200 values 12 parameters take 6 out of the noise.
    cost = Misfit(model, campaign, fitted.parametrisation, model_error_floor=0.0)
    at_truth = cost.value(fitted.parametrisation.coordinates(true_theta))
    assert fitted.cost == pytest.approx(at_truth, rel=0.005)
    assert fitted.cost <= at_truth
    assert misfit(fitted.theta) == pytest.approx(1.0, abs=0.08)  # and the floor of 3e-4


def test_the_cost_is_that_of_the_parameters_which_are_returned(fitted, model, campaign):
    cost = Misfit(model, campaign, fitted.parametrisation, model_error_floor=0.0)
    assert fitted.cost == pytest.approx(cost.value(fitted.x), rel=1e-6)


def test_random_starts_find_the_same_minimum_and_say_which_did_not(model, campaign, fitted):
    # A start in a second minimum would be told by its cost; the best start goes on.
    result = fit(model, campaign, starts=random_starts(model, 4, seed=3))
    assert len(result.start_costs) == len(result.start_thetas) == 4
    assert (
        result.agreeing_starts
        == sum(cost <= 1.02 * min(result.start_costs) for cost in result.start_costs)
        >= 3
    )
    assert result.theta == pytest.approx(fitted.theta, rel=1e-4)
    assert result.cost == pytest.approx(fitted.cost, rel=1e-5)


def test_the_start_does_not_matter_to_the_last_digit_that_counts(model, campaign, fitted):
    # It ends when a step promises less than 0.01 nats: 0.14 standard deviations of anything.
    second = fit(model, campaign, starts=random_starts(model, 2, seed=8)[1:])
    cost = Misfit(model, campaign, fitted.parametrisation, model_error_floor=0.0)
    curvature = cost.quadratic_model(fitted.x)[2].dense()
    way = second.x - fitted.x
    assert 0.5 * way @ curvature @ way < 0.02


def test_random_starts_are_the_drawing_and_then_its_multiples(model):
    starts = random_starts(model, 3, seed=3)
    assert starts[0] == pytest.approx(model.drawn)
    assert all((start > 0).all() for start in starts)
    assert not np.allclose(starts[1], starts[2])
    assert random_starts(model, 3, seed=3)[2] == pytest.approx(starts[2])


def test_random_starts_move_nothing_that_the_drawing_knows(whole):
    drawn, second = random_starts(whole, 2, seed=3)
    is_no_spring = np.array(
        [parameter.known not in ("stiffness", "damping") for parameter in whole.parameters]
    )
    assert np.array_equal(drawn, whole.drawn)
    assert np.array_equal(second[is_no_spring], whole.drawn[is_no_spring])
    assert (second[~is_no_spring] != whole.drawn[~is_no_spring]).all()


def test_exact_data_are_fitted_exactly(model, true_theta):
    exact = virtual_campaign(model, true_theta, noise=1e-6)
    stages = (Stage(0.5, stride=4), Stage(0.1), Stage(0.01))
    result = fit(model, exact, stages=stages)
    assert result.theta == pytest.approx(true_theta, rel=0.01)
    assert fit(model, exact).theta == pytest.approx(true_theta, rel=1e-5)


@pytest.mark.parametrize("algorithm", [TUNING_ALGORITHM, "LD_SLSQP", "LD_MMA"])
def test_algorithms_by_name_reach_the_same_opening_minimum(model, campaign, algorithm):
    stages = (STAGES[0], Stage(0.2, tolerance=1e-8, stride=8))
    expected, actual = (
        fit(model, campaign, stages=stages, algorithm=name) for name in (GAUSS_NEWTON, algorithm)
    )
    assert actual.converged
    assert actual.cost == pytest.approx(expected.cost, rel=1e-4)
    assert actual.theta == pytest.approx(expected.theta, rel=0.02)


def test_nlopt_needs_about_as_many_evaluations_as_gauss_newton(model, campaign, fitted):
    # All stages, from the nominal model and from random starts.
    for start in random_starts(model, 3, seed=21):
        newton, nlopt = (
            fit(model, campaign, starts=(start,), algorithm=name)
            for name in (GAUSS_NEWTON, TUNING_ALGORITHM)
        )
        assert nlopt.converged
        assert nlopt.cost == pytest.approx(newton.cost, rel=1e-5)
        assert nlopt.evaluations <= 1.5 * newton.evaluations


def test_nlopt_drives_what_varies_without_tolerances_and_gauss_newton_the_rest(
    whole, mixed, monkeypatch
):
    drivers = []
    for name in ("gauss_newton", "search_whitened"):
        inner = getattr(stage_search, name)

        def search(problem, x, *arguments, inner=inner, name=name, **named):
            drivers.append((name, len(x)))
            return inner(problem, x, *arguments, **named)

        monkeypatch.setattr(stage_search, name, search)
    stages = (*OPENING, Stage(0.1, tolerances_vary=True))
    result = fit(whole, mixed, stages=stages, algorithm=TUNING_ALGORITHM)
    size, n_prior = result.parametrisation.size, int(result.parametrisation.is_tolerance.sum())
    assert drivers == [
        ("search_whitened", size - n_prior),
        ("search_whitened", size - n_prior),
        ("gauss_newton", size),
    ]


def test_an_algorithm_that_does_not_exist_is_refused(model, campaign):
    with pytest.raises(UsageError, match="LD_LBFGS"):
        fit(model, campaign, algorithm="LD_NONSENSE")


def test_the_result_does_not_depend_on_the_number_of_processes(whole, mixed):
    starts = random_starts(whole, 3, seed=5)
    stages = (STAGES[0], Stage(0.1, tolerances_vary=True))
    first, second = (fit(whole, mixed, starts=starts, stages=stages, jobs=jobs) for jobs in (1, 2))
    assert np.array_equal(first.x, second.x)
    assert np.array_equal(first.start_thetas, second.start_thetas)
    assert (first.start_costs, first.cost, first.evaluations) == (
        second.start_costs,
        second.cost,
        second.evaluations,
    )


def test_every_stage_is_told_by_its_number_start_and_evaluation(model, campaign):
    reports = []
    result = fit(
        model, campaign, starts=random_starts(model, 2, seed=3), stages=STAGES[:3],
        report=reports.append,
    )  # fmt: skip
    begins = [(step.start, step.stage) for step in reports]
    order = list(dict.fromkeys(begins))
    assert order[:4] == [(0, 0), (0, 1), (1, 0), (1, 1)]
    assert order[4] in {(0, 2), (1, 2)}  # tolerances vary from the best start on
    assert len(order) == 5
    assert len(reports) <= result.evaluations


def test_every_so_manyth_line_counts_but_no_fewer_than_32(campaign):
    assert len(thin_lines(campaign, 4).freq_hz) == 40
    assert len(thin_lines(campaign, 40).freq_hz) == 32
    assert len(thin_lines(campaign.select_lines(slice(20)), 8).freq_hz) == 20


@pytest.mark.parametrize("algorithm", [GAUSS_NEWTON, TUNING_ALGORITHM])
def test_an_interrupt_in_the_middle_keeps_the_best_parameters(model, campaign, misfit, algorithm):
    def interrupt(step):
        if step.stage == 4 and step.evaluation > 1:
            raise KeyboardInterrupt

    result = fit(model, campaign, report=interrupt, algorithm=algorithm)
    assert result.outcome == "interrupted"
    assert not result.converged
    before = fit(model, campaign, stages=STAGES[:4], algorithm=algorithm)
    assert misfit(result.theta) < 0.1 * misfit(model.drawn)
    assert misfit(result.theta) <= misfit(before.theta)


@pytest.mark.parametrize("at", [2, 3])  # the third goes on from the best of all starts
def test_an_interrupt_between_two_stages_keeps_what_the_first_have_found(
    model, campaign, monkeypatch, at
):
    expected = fit(model, campaign, stages=STAGES[: at - 1]).theta
    interrupt_when_made_ready(monkeypatch, at)
    result = fit(model, campaign, stages=STAGES[:at])
    assert result.outcome == "interrupted"
    assert result.theta == pytest.approx(expected, rel=1e-12)


def test_an_interrupt_before_anything_is_found_says_so(model, campaign, monkeypatch):
    interrupt_when_made_ready(monkeypatch, 1)
    with pytest.raises(KeyboardInterrupt):
        fit(model, campaign, stages=STAGES[:2])


def test_an_interrupt_after_a_stage_is_written_down_keeps_it(model, campaign, monkeypatch):
    expected = fit(model, campaign, stages=STAGES[:1]).theta
    keep = Checkpoint.keep

    def kept(checkpoint, step, end):
        keep(checkpoint, step, end)
        raise KeyboardInterrupt

    monkeypatch.setattr(Checkpoint, "keep", kept)
    result = fit(model, campaign, stages=STAGES[:2])
    assert result.outcome == "interrupted"
    assert result.theta == pytest.approx(expected, rel=1e-12)


def interrupt_when_made_ready(monkeypatch, at):
    made, seen = Stage.build_misfit, []

    def ready(stage, *arguments, **named):
        seen.append(stage)
        if len(seen) == at:
            raise KeyboardInterrupt
        return made(stage, *arguments, **named)

    monkeypatch.setattr(Stage, "build_misfit", ready)


def test_an_interrupt_before_a_second_start_leaves_the_first(model, campaign, monkeypatch):
    first = fit(model, campaign, stages=OPENING)
    interrupt_when_made_ready(monkeypatch, 1 + len(OPENING))
    result = fit(model, campaign, starts=random_starts(model, 2, seed=3))
    assert result.outcome == "interrupted"
    assert result.theta == pytest.approx(first.theta, rel=1e-12)


def test_an_interrupted_second_start_leaves_the_first_to_be_kept(model, campaign, misfit):
    def interrupt(step):
        if step.start == 1:
            raise KeyboardInterrupt

    result = fit(model, campaign, starts=random_starts(model, 3, seed=3), report=interrupt)
    first = fit(model, campaign, stages=OPENING)
    assert result.outcome == "interrupted"
    assert result.theta == pytest.approx(first.theta, rel=1e-12)


# What follows has masses, joints, sensors and hammer that are really off by their tolerances.


def toleranced_campaign(model, theta):
    return replace(virtual_campaign(model, theta, noise=0.03), tolerance=TOLERANCE)


@pytest.fixture(scope="module")
def off_campaign(whole, parametrisation, off):
    return toleranced_campaign(whole, parametrisation.theta(off))


@pytest.fixture(scope="module")
def limited(whole, off_campaign):
    """The Parts that a session would take for this campaign."""
    return build_toleranced_model(whole.machine, off_campaign)


@pytest.fixture(scope="module")
def joint(limited, off_campaign):
    return fit(limited, off_campaign)


def reduced(model, campaign, parametrisation, x):
    """Misfit of the data per value, 1 if noise alone is left; each real coordinate takes a half."""
    cost = Misfit(model, campaign, parametrisation, model_error_floor=0.0)
    return (cost.value(x) - cost.prior(x)) / (cost.values - 0.5 * parametrisation.size)


def test_with_tolerances_the_fit_reaches_the_noise(limited, off_campaign, joint):
    assert joint.converged
    result = reduced(limited, off_campaign, joint.parametrisation, joint.x)
    assert result == pytest.approx(1.0, abs=0.06)


def test_stiffness_and_damping_alone_do_not_reach_it(whole, off_campaign):
    springs = as_drawn(whole.machine)
    result = fit(springs, off_campaign)
    assert reduced(springs, off_campaign, result.parametrisation, result.x) > 2.0


def test_pulls_are_as_large_as_standard_deviations_are(joint):
    pulls = joint.x[joint.parametrisation.is_tolerance]
    assert np.abs(pulls).max() <= 2.5
    assert np.sqrt((pulls**2).mean()) == pytest.approx(1.0, abs=0.35)


def test_the_truth_lies_within_the_predicted_intervals(
    limited, off_campaign, joint, parametrisation, off
):
    true_x = dict(zip(parametrisation.names, off, strict=True))
    truth = np.array([true_x.get(name, 0.0) for name in joint.parametrisation.names])
    normal = (
        Misfit(limited, off_campaign, joint.parametrisation, model_error_floor=0.0)
        .quadratic_model(joint.x)[2]
        .dense()
    )
    precision = normal + np.diag(joint.parametrisation.precision)
    deviation = np.sqrt(np.diag(np.linalg.inv(precision)))
    score = (joint.x - truth) / deviation
    assert np.abs(score).max() < 4.0
    assert np.sqrt((score**2).mean()) == pytest.approx(1.0, abs=0.3)


def test_the_first_stages_leave_tolerances_where_they_are(limited, off_campaign):
    parametrisation = parametrise(limited, off_campaign.tolerance)
    random = np.random.default_rng(9)
    x = np.where(parametrisation.is_tolerance, random.normal(0.0, 0.5, parametrisation.size), 0.0)
    result = fit(limited, off_campaign, starts=(parametrisation.theta(x),), stages=OPENING)
    np.testing.assert_allclose(
        result.x[parametrisation.is_tolerance], x[parametrisation.is_tolerance], atol=1e-12
    )
    assert (result.x[~parametrisation.is_tolerance] != 0).all()


def test_a_fault_beyond_tolerances_ends_at_bounds_and_above_the_noise(
    whole, limited, parametrisation, off
):
    # One sensor turned by 20 degrees: 2.5 tolerances of one degree cannot swallow it ...
    x = off.copy()
    x[parametrisation.names.index("acc4.rotation_z")] = 20.0
    faulty = toleranced_campaign(whole, parametrisation.theta(x))
    result = fit(limited, faulty)
    at = [p.name for p, at in zip(limited.parameters, result.at_bound, strict=True) if at]
    assert "acc4.rotation_z" in at
    assert reduced(limited, faulty, result.parametrisation, result.x) > 2.0
    # ... without bounds they would.
    loose = fit(
        limited,
        faulty,
        parametrisation=result.parametrisation.lift_bounds(),
        starts=(result.theta,),
        stages=STAGES[-1:],
    )
    assert reduced(limited, faulty, loose.parametrisation, loose.x) == pytest.approx(1.0, abs=0.06)
    assert loose.x[loose.parametrisation.names.index("acc4.rotation_z")] == pytest.approx(
        20.0, abs=2.5
    )
