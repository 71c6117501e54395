"""Up to where bodies move as solids: drawn machines whose answer is known."""

from dataclasses import replace

import numpy as np
import pytest
from solid_bodies import Case, draw, only, triaxials

from identification import check_bodies
from identification.solid import fault_search
from identification.solid.body_channels import body_data, join_tests
from identification.solid.ranking import _held_out_cost, _restart_null, rank_faults
from identification.solid.rigid_fit import Moments, RigidFitModel, fit_errors
from identification.solid.screening import BodyFit
from identification.solid.sensor_faults import BelievedBody, list_hypotheses
from identification.words import (
    Campaign,
    Condition,
    Dof,
    Frf,
    FrfEstimate,
    Layout,
    Test,
    Tolerance,
)

LINES = 200


def check(case: Case):
    (found,) = check_bodies(draw(case))
    return found


def first_sensors(campaign: Campaign, count: int) -> Campaign:
    """Only the channels of a body's first sensors."""
    points = campaign.layout.points[:count]
    return only(campaign, [dof for dof in triaxials(campaign.layout) if dof.point in points])


def test_a_solid_body_within_tolerance_has_no_fault_in_thirty_draws():
    named = []
    for seed in range(30):
        found = check(Case(1000 + seed, sensors=3 + seed % 2, lines=160))
        if found.faults or found.has_unexplained or found.solid_to_hz != found.freq_hz[-1]:
            named.append((seed, found.sentence))
    assert not named, named


def read_times(channel: int, gain: float):
    def read(_: np.ndarray, values: np.ndarray) -> np.ndarray:
        changed = values.copy()
        changed[:, channel] *= gain
        return changed

    return read


@pytest.mark.parametrize(("gain", "effect"), [(0.095, "sensor_gain"), (0.0, "dead_channel")])
@pytest.mark.parametrize("seed", [1201, 1203])
def test_a_channel_that_reads_a_tenth_is_not_dead(seed, gain, effect):
    found = check(Case(seed, lines=LINES, read=read_times(4, gain)))
    (fault,) = found.faults
    assert (fault.effect, fault.location) == (effect, f"sensor:{found.channels[4].point}")
    if gain:
        assert fault.parameters["gain"] == pytest.approx(gain, rel=0.1)


@pytest.mark.parametrize("seed", [1214, 1216])
def test_a_dead_channel_that_no_other_could_contradict_is_no_proof_of_stillness(seed):
    # Three heights make z and two turns: no spare tells whether the third reads or is off.
    case = Case(seed, sensors=3, lines=LINES, noise=0.001, level=True, read=read_times(8, 0.0))
    found = check(case)
    assert len(found.channels) == 8
    assert not found.faults, found.sentence
    assert found.excess.mean() < 1.1


@pytest.mark.parametrize("stated", [0.83, 1.2], ids=["noise overstated", "noise understated"])
def test_noise_misstated_by_a_fifth_makes_no_fault(stated):
    for seed in range(2):
        found = check(Case(1100 + seed, lines=LINES, noise=0.05, noise_misstated=stated))
        assert not found.faults, found.sentence
        assert found.solid_to_hz == found.freq_hz[-1]


def test_scatter_of_hits_is_no_noise_that_sensors_are_turned_towards():
    # In a plane, channels across it read errors alone, with little noise beside that of the others.
    for seed in range(4):
        case = Case(1150 + seed, sensors=3, lines=LINES, noise=2e-3, planar=True, scatter=0.05)
        campaign = draw(case)
        (found,) = check_bodies(campaign)
        assert not found.faults, found.sentence
        data = body_data(join_tests(campaign), campaign, "body0")
        state = BelievedBody.healthy(data, campaign.tolerance)
        fitted = fit_errors(state.model, Moments.of(data, blocks=1))
        assert fitted.prior < len(fitted.errors), "errors are about one standard deviation"


def test_tolerances_of_three_standard_deviations_make_no_fault_of_the_second_order():
    # Drawn three times as wide as stated, most errors lie within what a fit must follow exactly.
    tolerance = Case(0).tolerance
    wide = replace(tolerance, sensor_angle=3 * tolerance.sensor_angle)
    campaign = draw(Case(1200, lines=LINES, noise=0.003, tolerance=wide))
    (found,) = check_bodies(campaign)
    assert not found.faults, found.sentence
    assert (found.deviation <= found.hidden).all()
    assert np.median(found.hidden) < 0.003


def test_the_fit_recovers_what_can_be_seen_of_the_sensors_errors():
    # Reconstruction with fitted errors is better than as drawn by an order, down to the noise.
    found = check(Case(1300, lines=LINES, noise=0.001))
    high = found.freq_hz > 60
    assert np.median(found.reconstruction[high]) > 0.008
    assert np.median(found.deviation[high]) < 0.001
    assert 0.9 < np.median(found.excess[high]) < 1.1


def test_the_reconstruction_is_as_far_off_as_noise_and_tolerances_tell():
    # One spare channel: the squared ratio is that of few errors, 1 in the mean with a scatter of
    # some 0.9 a draw.
    ratios = []
    for seed in range(30):
        campaign = draw(Case(1400 + seed, sensors=3, lines=LINES, noise=0.002))
        (found,) = check_bodies(only(campaign, list(triaxials(campaign.layout))[:7]))
        high = found.freq_hz > 40
        ratios.append(np.sum(found.reconstruction[high] ** 2) / np.sum(found.expected[high] ** 2))
    assert abs(np.mean(ratios) - 1) < 3 * 0.9 / np.sqrt(30)


def beam(seed: int) -> Campaign:
    """A body whose readings follow eight bending modes of a beam, none of them rigid."""
    rng = np.random.default_rng(seed)
    campaign = draw(Case(seed, lines=LINES, noise=0.01))
    along = campaign.layout.positions[:, 0] - campaign.layout.positions[:, 0].min()
    places = np.repeat(along / along.max(), 3)
    axes = campaign.layout.axes.transpose(0, 2, 1).reshape(-1, 3)
    freq = campaign.freq_hz
    tests = []
    for test in campaign.tests:
        values = np.zeros((len(freq), 12, 1), complex)
        for k in range(1, 9):
            ratio = freq / (8.0 * k**2)
            gain = ratio**2 / (1 - ratio**2 + 0.04j * ratio)
            shape = np.cos(np.pi * k * places) * (axes @ rng.normal(size=3)) * rng.normal()
            values[:, :, 0] += gain[:, None] * shape
        frf = Frf(freq, values, test.estimate.frf.outputs, test.estimate.frf.inputs, "accelerance")
        noise = 1e-4 * np.mean(np.abs(values) ** 2) * np.ones(values.shape)
        tests.append(replace(test, estimate=replace(test.estimate, frf=frf, variance=noise)))
    return replace(campaign, tests=tuple(tests))


def test_a_beam_is_not_taken_for_a_solid():
    (found,) = check_bodies(beam(1800))
    assert found.solid_to_hz is None or found.solid_to_hz < 40
    assert np.median(found.deviation) > 0.1
    assert found.has_unexplained or any(fault.effect == "flexible_body" for fault in found.faults)


# What cannot be checked.


def test_a_body_without_spare_channels_says_that_no_check_is_possible():
    campaign = draw(Case(1900, lines=60))
    outputs = list(triaxials(campaign.layout))
    (found,) = check_bodies(only(campaign, [*outputs[:3], outputs[4], outputs[8], outputs[10]]))
    assert (found.rank, found.redundant) == (6, 0)
    assert found.solid_to_hz is None
    assert not found.faults
    assert "no check is possible" in found.sentence


def test_two_triaxials_see_their_distance_alone_and_place_no_fault():
    (found,) = check_bodies(first_sensors(draw(Case(1901, lines=60)), 2))
    assert (found.rank, found.redundant) == (5, 1)
    assert not found.faults
    assert "cannot locate a fault" in found.sentence


def test_one_triaxial_cannot_be_checked():
    (found,) = check_bodies(first_sensors(draw(Case(1902, lines=60)), 1))
    assert (found.rank, found.redundant) == (3, 0)
    assert "no check is possible" in found.sentence


def test_a_body_without_channels_is_left_out():
    campaign = draw(Case(1903, bodies=2, lines=60))
    outputs = [dof for dof in triaxials(campaign.layout) if dof.point.startswith("p1")]
    assert [found.body for found in check_bodies(only(campaign, outputs))] == ["body1"]


# The fit itself.


def test_gradient_and_curvature_are_those_of_the_cost():
    campaign = draw(Case(2200, lines=60))
    data = body_data(join_tests(campaign), campaign, "body0")
    moments = Moments.of(data)
    spread = data.sensors.spread(campaign.tolerance)
    model = RigidFitModel(data.sensors, data.scale, spread, np.zeros((12, 0)))
    rng = np.random.default_rng(3)
    errors = 0.5 * spread * rng.normal(size=len(spread))
    gradient, _ = model.slopes(moments, errors)
    for _ in range(5):
        change = 1e-4 * spread * rng.normal(size=len(spread))
        ahead, behind = (
            model.data(moments, data.sensors.step(errors, sign * change)) for sign in (1, -1)
        )
        assert ahead - behind == pytest.approx(2 * gradient @ change, rel=1e-4)


def test_noise_alone_costs_nothing_in_the_mean():
    # tr(P (G - V)) of a rigid body at the true errors: mean 0, variance 6 a value.
    costs = []
    for seed in range(40):
        exact = Tolerance(
            sensor_gain=0, sensor_angle=0, sensor_position=0, sensor_delay=0, sensor_cross=0
        )
        campaign = draw(Case(2300 + seed, lines=60, tolerance=exact, averages=200))
        data = body_data(join_tests(campaign), campaign, "body0")
        spread = data.sensors.spread(campaign.tolerance)
        model = RigidFitModel(data.sensors, data.scale, spread, np.zeros((12, 0)))
        moments = Moments.of(data, blocks=1)
        costs.append(model.data(moments, np.zeros(len(spread))) / np.sqrt(6 * 60 * 3))
        assert fit_errors(model, moments).prior < 1e-3
    assert abs(np.mean(costs)) < 3 / np.sqrt(40)
    assert 0.7 < np.std(costs) < 1.3


def test_a_direction_in_which_nothing_moves_makes_no_fault() -> None:
    # Three triaxials that only move along x: what y and z read is noise, of whatever size.
    for seed in range(3):
        rng = np.random.default_rng(70_000 + seed)
        places = rng.uniform(-0.3, 0.3, (3, 3))
        names = ("acc1", "acc2", "acc3")
        axes = np.tile(np.eye(3), (3, 1, 1))
        layout = Layout(("b",), np.zeros((1, 3)), names, np.zeros(3, int), places, axes)
        outputs = tuple(Dof.of(name, axis) for name in names for axis in range(3))
        freq = np.arange(10.0, 110, 0.5)
        moved = 1 / (60.0**2 - freq**2 + 2j * 0.02 * 60 * freq) * freq**2
        values = np.zeros((len(freq), 9, 1), complex)
        values[:, ::3, 0] = moved[:, None]
        sd = np.full((9, 1), 1e-5)
        sd[::3] = 0.01 * np.sqrt((np.abs(moved) ** 2).mean())
        noise = rng.normal(size=(2, *values.shape)) * sd / np.sqrt(2)
        reference = Dof("acc1", "+tx")
        frf = Frf(freq, values + noise[0] + 1j * noise[1], outputs, (reference,), "accelerance")
        variance = np.broadcast_to(sd**2, values.shape)
        estimate = FrfEstimate(frf, variance, "coherence", np.ones((9, 1), bool))
        tests = (Test(Condition("a.uff", reference), estimate),)
        (check,) = check_bodies(Campaign("c", layout, tests))
        assert check.faults == ()
        assert len(check.channels) == 3, "those along x"
        assert "no check is possible" in check.sentence


@pytest.mark.parametrize("seed", [1220, 1232])
def test_a_dead_channel_is_told_however_few_values_a_block_holds(seed):
    found = check(Case(seed, sensors=3, lines=120, noise=0.0005, read=read_times(2, 0.0)))
    assert [one.effect for one in found.faults] == ["dead_channel"]


def test_what_was_named_while_a_dead_channel_was_believed_is_asked_again(monkeypatch):
    asked = []

    def misled(state, tolerance, done, before=None):
        found = rank_faults(state, tolerance, done, before)
        asked.append(state.extra.shape[1])
        if len(asked) > 1:
            return found
        turned = (one for one in list_hypotheses(state) if one.effect == "sensor_misalignment")
        wrong = next(one for one in turned if one.location == "sensor:p0_0")
        first = _held_out_cost(wrong, wrong.states(state)[0], found.body_fit)
        return replace(
            found,
            candidates=(first, *found.candidates),
            nats=np.append(0.0, found.nats),
            probability=np.append(1.0, found.probability),
        )

    monkeypatch.setattr(fault_search, "rank_faults", misled)
    found = check(Case(1201, lines=LINES, read=read_times(4, 0.0)))
    assert [one.effect for one in found.faults] == ["dead_channel"]
    assert asked == [0, 0, 1, 0, 1]  # misled, the dead one, the rest; then the dead one first


def test_a_healthy_body_is_fitted_from_where_the_best_fault_ended_too():
    campaign = draw(Case(5001, sensors=3, lines=120, noise=1e-3))
    data = body_data(join_tests(campaign), campaign, campaign.layout.bodies[0])
    state = BelievedBody.healthy(data, campaign.tolerance)
    body_fit = BodyFit.at(state, campaign.tolerance)
    healthy = _held_out_cost(None, state, body_fit)
    turned = next(one for one in list_hypotheses(state) if one.effect == "sensor_misalignment")
    fault = _held_out_cost(turned, turned.states(state)[0], body_fit)
    # An end with tolerances of ten standard deviations, which the release of one got past.
    stuck = replace(healthy, cost=healthy.cost + 150)
    found = _restart_null([stuck, fault], state, body_fit)
    assert found.hypothesis is None
    assert found.cost == pytest.approx(healthy.cost, abs=0.1)
    assert found.data == pytest.approx(healthy.data, abs=0.5)
    assert _restart_null([healthy, fault], state, body_fit) is healthy
    assert _restart_null([stuck], state, body_fit) is stuck
