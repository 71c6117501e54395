"""The linearised refit against least squares made another way, and against what it must mean."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from tests.helpers.linearised import write_out
from truth.campaign.cause import Cause, Wanted, draw_effects
from truth.campaign.draw import Tolerances, draw_hammers
from truth.campaign.frf_sensitivities import jacobian, jacobian_again
from truth.campaign.linear_refit import BOUND, normal_matrix
from truth.campaign.machine_on_test import TrueMachine
from truth.campaign.measure import hammer_tests
from truth.campaign.protocol import Protocol, occasions, takes
from truth.campaign.survival import refit_of
from truth.campaign.virtual_test import Plan, draw_campaign
from truth.effects import CATALOGUE, Scene
from truth.errors import NoPlaceError, TruthError
from truth.machine.random_tree import draw_tree
from truth.machine.rig import Occasion, accelerance
from truth.machine.springs import ClosedLoop, Motor
from truth.random_streams import stream

TOLERANCE = Tolerances()
PROTOCOL = Protocol((1,), averages=10, lines=201, resolution_hz=1.0)


@pytest.fixture(scope="module")
def machine(two_bodies):
    return TrueMachine(two_bodies, draw_hammers(two_bodies, 1, TOLERANCE, 3))


@pytest.fixture(scope="module")
def refit(machine):
    return refit_of(machine, PROTOCOL, takes(PROTOCOL, machine.station, 1), TOLERANCE)


def frf(machine, freq_hz):
    return accelerance(machine.rig(Occasion()), freq_hz)


def slope(before, after, machine, refit, step):
    lines = refit.known.freq_hz
    return (frf(after, lines) - frf(before, lines)) / (2 * step) / refit.deviation


def changed_stage(machine, index, **change):
    stages = list(machine.station.stages)
    stages[index] = replace(stages[index], **change)
    return replace(machine, station=replace(machine.station, stages=tuple(stages)))


def columns(values, refit):
    shape = refit.deviation.shape
    real, imag = values.T.reshape(-1, 2, *shape).swapaxes(0, 1)
    return real + 1j * imag


def test_slopes_are_differences_of_the_whole_frf(machine, refit):
    # In the order of a stage's parameters: k and c of six joints; mass, inertia, com, position.
    springs, tolerances = (
        columns(values, refit) for values in (refit.slopes.springs, refit.slopes.tolerances)
    )
    for index, stage in enumerate(machine.station.stages):
        for number, name in ((0, "stiffness"), (4, "damping")):
            joint = stage.joints[number]
            ends = []
            for way in (-1e-4, 1e-4):
                joints = list(stage.joints)
                joints[number] = replace(joint, **{name: getattr(joint, name) * np.exp(way)})
                ends.append(changed_stage(machine, index, joints=tuple(joints)))
            expected = slope(*ends, machine, refit, 1e-4)
            np.testing.assert_allclose(
                springs[12 * index + 2 * number + (name == "damping")],
                expected,
                atol=1e-6 * abs(expected).max(),
            )
        for step, place, change in (
            (1e-3, 0, lambda way, s=stage: {"mass": s.mass * (1 + way * TOLERANCE.mass)}),
            (1e-2, 7, lambda way, s=stage: {"com": s.com + way * TOLERANCE.com * np.eye(3)[0]}),
            (
                1e-2,
                10,
                lambda way, s=stage: {
                    "joints": tuple(
                        replace(
                            one,
                            position=one.position + way * TOLERANCE.joint_position * np.eye(3)[1],
                        )
                        for one in s.joints
                    )
                },
            ),
        ):
            ends = [changed_stage(machine, index, **change(way)) for way in (-step, step)]
            expected = slope(*ends, machine, refit, step)
            np.testing.assert_allclose(
                tolerances[13 * index + place], expected, atol=1e-5 * abs(expected).max()
            )


def test_a_hammer_slope_is_the_difference_of_another_hit(machine, refit):
    found, first = columns(refit.slopes.tolerances, refit), 2 * 13
    hammer, step = machine.hammers[0], 1e-3
    for place, change in (
        (first, {"direction": np.cross(TOLERANCE.hammer_angle * np.eye(3)[0], hammer.direction)}),
        (first + 3, {"position": TOLERANCE.hammer_position * np.eye(3)[1]}),
    ):
        ends = []
        for way in (-step, step):
            moved = {name: getattr(hammer, name) + way * by for name, by in change.items()}
            hammers = (replace(hammer, **moved), *machine.hammers[1:])
            ends.append(replace(machine, hammers=hammers))
        expected = slope(*ends, machine, refit, step)
        np.testing.assert_allclose(found[place], expected, atol=1e-6 * abs(expected).max())


def test_a_rigid_direction_has_the_right_slopes(two_bodies):
    lower, upper = two_bodies.stages
    rigid = replace(two_bodies, stages=(lower, replace(upper, joints=upper.joints[:4])))
    machine = TrueMachine(rigid, draw_hammers(rigid, 1, TOLERANCE, 3))
    refit = refit_of(machine, PROTOCOL, takes(PROTOCOL, rigid, 1), TOLERANCE)
    place = 13 + 1 + 6  # com of the upper stage along x
    shifts = (-1e-2 * TOLERANCE.com * np.eye(3)[0], 1e-2 * TOLERANCE.com * np.eye(3)[0])
    ends = [
        changed_stage(machine, 1, com=machine.station.stages[1].com + shift) for shift in shifts
    ]
    expected = slope(*ends, machine, refit, 1e-2)
    by_mass_centre = columns(refit.slopes.tolerances, refit)[place]
    np.testing.assert_allclose(by_mass_centre, expected, atol=1e-5 * abs(expected).max())


def test_the_slopes_of_an_encoder_in_a_loop_are_those_of_its_joint(two_bodies):
    name = two_bodies.stages[1].joints[1].name
    stiffer = two_bodies.stages[1].joints[1].stiffness
    loop = ClosedLoop("drive", name, lambda s: stiffer * (1 + 2e-3 * s), "", {})
    motors = (Motor("drive", ((name, 1.0),)),)
    station = replace(two_bodies, motors=motors, loops=(loop,)).with_encoders({"ruler": (name, 0)})
    machine = TrueMachine(station, draw_hammers(station, 1, TOLERANCE, 3))
    refit = refit_of(machine, PROTOCOL, takes(PROTOCOL, station, 1), TOLERANCE)
    slopes, upper, axis = columns(refit.slopes.tolerances, refit), station.stages[1], np.eye(3)[0]

    def with_place(way):
        shift = way * TOLERANCE.joint_position * axis
        joints = [replace(joint, position=joint.position + shift) for joint in upper.joints]
        return changed_stage(machine, 1, joints=tuple(joints))

    def with_com(way):
        return changed_stage(machine, 1, com=upper.com + way * TOLERANCE.com * axis)

    for place, change in ((13 + 7, with_com), (13 + 8, with_place)):
        expected = slope(change(-1e-2), change(1e-2), machine, refit, 1e-2)
        for result, row in zip(slopes[place].swapaxes(0, 1), expected.swapaxes(0, 1), strict=True):
            np.testing.assert_allclose(result, row, atol=1e-5 * np.abs(row).max())
    weighted = frf(machine, refit.known.freq_hz) / refit.deviation
    gain, *places = refit.slopes.of_sensors[-1].T[:3]
    reading = np.zeros((2, len(weighted), 3, 3))
    reading[:, :, 0] = TOLERANCE.sensor_gain * np.array(
        [weighted[:, -3].real, weighted[:, -3].imag]
    )
    np.testing.assert_allclose(gain, reading.ravel(), rtol=1e-8, atol=1e-12)
    assert not np.any(places)


def test_the_normal_matrix_is_that_of_the_jacobian_written_out(refit):
    shape = refit.deviation.shape
    full = write_out(refit.slopes, shape)
    expected = full.T @ full
    normal = normal_matrix(refit.slopes, shape)
    np.testing.assert_allclose(normal, expected, rtol=1e-10, atol=1e-12 * expected.max())
    reversed_springs = replace(
        refit.slopes, springs=np.asfortranarray(refit.slopes.springs[:, ::-1])
    )
    again = normal_matrix(reversed_springs, shape, normal)
    expected = normal_matrix(reversed_springs, shape)
    np.testing.assert_allclose(again, expected, rtol=1e-12, atol=1e-14 * expected.max())


def test_slopes_over_other_deviations_are_those_made_with_them(machine, refit):
    before, weight = (
        refit.used[:, None]
        / np.hypot(refit.deviation, size * np.abs(refit.known.on(Occasion())[1]))
        for size in (0.0, 0.1)
    )
    weighted = refit.slopes.weighted_anew(before, weight)
    expected = jacobian(machine, refit.known.freq_hz, TOLERANCE, weight)
    for name in ("springs", "tolerances", "of_sensors"):
        size = np.abs(getattr(expected, name)).max()
        np.testing.assert_allclose(
            getattr(weighted, name), getattr(expected, name), rtol=1e-10, atol=1e-13 * size
        )


def test_the_fit_is_the_bounded_least_squares_one(refit):
    # All columns side by side, priors as rows below, solved by another algorithm.
    shape = refit.deviation.shape
    random = stream(1, "change")
    shared = np.hstack([refit.slopes.springs, refit.slopes.tolerances])
    sizes = random.normal(0, 4, shared.shape[1])
    change = np.tensordot(sizes, columns(shared, refit), 1) * refit.deviation
    dense = write_out(refit.slopes, shape)
    matrix = np.vstack([dense, np.diag(refit.bounded.astype(float))])
    weighted = change / refit.deviation
    aim = np.concatenate(
        [weighted.real.ravel(), weighted.imag.ravel(), np.zeros(len(refit.normal))]
    )
    limit = np.where(refit.bounded, BOUND, np.inf)
    best = lsq_linear(matrix, aim, (-limit, limit), tol=1e-12, max_iter=500)
    left = (change - refit.fit_change(change)) / refit.deviation
    assert np.any(np.abs(best.x[refit.bounded]) > 0.99 * BOUND)
    fitted = (matrix[: weighted.size * 2] @ best.x).reshape(2, *shape)
    expected = weighted - fitted[0] - 1j * fitted[1]
    assert np.linalg.norm(left - expected) <= 1e-3 * np.linalg.norm(expected)


def test_what_tuning_can_follow_leaves_nothing(machine, refit):
    joint = machine.station.stages[1].joints[2]
    joints = list(machine.station.stages[1].joints)
    joints[2] = replace(joint, stiffness=joint.stiffness * 1.00001)
    softer = changed_stage(machine, 1, joints=tuple(joints))
    change = refit.change(softer)
    assert np.linalg.norm(change) > 0
    assert refit.ratio(softer) < 1e-3 * refit_free(refit, change)


def test_the_change_of_another_effect_is_computed_anew(machine, refit):
    scene = Scene(machine.station, occasions(PROTOCOL, refit.takes))
    effect = CATALOGUE["feedback_delay"](stream(1, "x"), scene, None)
    ones, others = (replace(machine, effects=(effect.sized(size),)) for size in (1e-4, 2e-4))
    first, again = refit.change(ones), refit.change(replace(machine, effects=ones.effects))
    assert again is first
    second = refit.change(others)
    assert np.linalg.norm(second) > 1.5 * np.linalg.norm(first)
    np.testing.assert_array_equal(refit.change(ones), first)


def test_further_steps_follow_what_stiffness_and_damping_can_follow_far(machine, refit):
    joints = [
        replace(joint, stiffness=joint.stiffness * 1.05, damping=joint.damping * 0.9)
        for joint in machine.station.stages[1].joints
    ]
    other = changed_stage(machine, 1, joints=tuple(joints))
    first, after = refit.ratio(other), refit.retuned_ratio(other)
    assert first > 5  # one step from the truth does not come there
    assert after < 1e-3
    back = refit.relinearise(np.zeros((~refit.bounded).sum()), refit.deviation)
    np.testing.assert_allclose(back.slopes.springs, refit.slopes.springs)


def test_slopes_made_anew_are_those_of_the_other_machine(machine, refit):
    logarithms = np.linspace(-0.5, 0.5, int((~refit.bounded).sum()))
    other = refit.relinearise(logarithms, refit.deviation)
    weight = refit.used[:, None] / refit.deviation
    slopes = jacobian_again(other.machine, refit.known.freq_hz, weight, refit.slopes)
    np.testing.assert_allclose(slopes.springs, other.slopes.springs)
    assert slopes.tolerances is refit.slopes.tolerances


def test_a_weaker_damper_hides_a_short_delay(machine, refit):
    # k exp(-s tau) + c s is k + (c - k tau) s as long as w tau is small.
    scene = Scene(machine.station, occasions(PROTOCOL, refit.takes))
    effect = CATALOGUE["feedback_delay"](stream(1, "x"), scene, None)
    joint = effect.direction.joint(machine.station)
    short = effect.sized(0.9 * joint.damping / joint.stiffness)
    delayed = replace(machine, effects=(short,))
    assert refit.ratio(delayed) > 5
    assert refit.retuned_ratio(delayed) < 0.02 * refit.ratio(delayed)
    assert refit.retuned_ratio(delayed, least=100.0) > refit.retuned_ratio(
        delayed
    )  # it went no further


def refit_free(refit, change):
    """The same figure without a refit."""
    power = (np.abs(change) ** 2).sum(axis=0) / (refit.deviation**2).sum(axis=0)
    return np.sqrt(power[refit.used].mean())


def test_tolerances_swallow_a_turned_sensor_up_to_their_bound(machine, refit):
    scene = Scene(machine.station, occasions(PROTOCOL, refit.takes))
    effect = CATALOGUE["sensor_misalignment"](stream(1, "x"), scene, "sensor:acc2")
    ratios = []
    for sizes in (1.0, 20.0):
        turned = replace(machine, effects=(effect.sized(sizes * TOLERANCE.sensor_angle),))
        ratios.append(refit.ratio(turned) / refit_free(refit, refit.change(turned)))
    assert ratios[0] < 0.05  # one standard deviation is nothing
    assert ratios[1] > 0.4  # of twenty, the two and a half within the bound and little more


def test_the_deviation_is_that_of_the_hammer_test(machine, refit):
    # The variance that the files' own coherence gives, over ten tests, is what the refit expects.
    places = np.searchsorted(PROTOCOL.freq_hz, refit.known.freq_hz)
    rows = [3, 4, 5, 6, 7, 8, 0, 1, 2]  # nodes 1, 2, 3 of the file in the station's order
    variance = []
    for seed in range(10):
        (test,) = hammer_tests(machine, PROTOCOL, refit.takes, seed)
        g2 = test.coherence[places]
        known = np.abs(test.frf[places]) ** 2 * (1 - g2) / (g2 * (PROTOCOL.averages - 1))
        variance.append(known)
    ratio = np.mean(variance, axis=0) / refit.deviation[:, rows] ** 2
    assert np.median(ratio) == pytest.approx(1, abs=0.1)


def test_an_effect_is_made_as_strong_as_is_wanted(two_bodies):
    for ratio in (1.0, 4.0):
        plan = Plan(
            7, Cause((Wanted("structural_damping", "joint:holder", ratio),)), Protocol((1,))
        )
        text = draw_campaign(two_bodies, plan).answer.decode()
        (line,) = [one for one in text.splitlines() if one.startswith("ratio")]
        assert float(line.split()[2]) == pytest.approx(ratio, rel=0.09)


def test_an_effect_may_be_sized_for_a_parameter_of_its_answer(two_bodies):
    wanted = Wanted("sensor_delay", "sensor:acc1", parameter=("delay", 3e-4))
    plan = Plan(7, Cause((wanted,)), Protocol((1,)))
    answer = tomllib.loads(draw_campaign(two_bodies, plan).answer.decode())
    assert answer["parameters"]["delay"] == pytest.approx(3e-4)
    assert "ratio" not in answer
    too_large = replace(plan, cause=Cause((replace(wanted, parameter=("delay", 9.0)),)))
    with pytest.raises(NoPlaceError, match="no draw of 20 can have the delay 9"):
        draw_campaign(two_bodies, too_large)
    unknown = replace(plan, cause=Cause((replace(wanted, parameter=("mass", 1.0)),)))
    with pytest.raises(TruthError, match="no parameter 'mass' sets its size: it has delay"):
        draw_campaign(two_bodies, unknown)


def test_more_corrections_come_nearer_to_a_ratio_that_further_steps_hide():
    tree, off = draw_tree(3, 2), []
    protocol = Protocol((tree.first_aim(),), lines=201, resolution_hz=1.0)
    for corrections in (0, 1, 4):
        cause = Cause((Wanted("viscoelastic", None, 4.0, corrections),))
        answer = draw_campaign(tree, Plan(3, cause, protocol)).answer.decode()
        off.append(abs(np.log(tomllib.loads(answer)["ratio"] / 4.0)))
    assert off[2] < 0.1
    assert off[2] < off[1] < off[0]


def test_a_correction_that_leaves_too_much_is_taken_back(machine):
    """A size between two that were tried has the ratio.

    The first step of a refit has the ratio 40 s for a mass of s times the body's, all steps have
    1.34 (s / 0.1)^1.9. One correction aims at 4 * 4 / 1.34 and ends at a ratio of 10.7 for s = 0.3.
    A ratio of 4 belongs to s = 0.178.
    """

    class Hiding:
        def ratio(self, loaded):
            return 40 * loaded.effects[0].size

        def retuned_ratio(self, loaded, least):
            return 1.34 * (loaded.effects[0].size / 0.1) ** 1.9

    scene = Scene(machine.station, occasions(PROTOCOL, takes(PROTOCOL, machine.station, 1)))
    cause = Cause((Wanted("mass_error", None, 4.0),))
    (drawn,) = draw_effects(machine, scene, cause, Hiding, 1).drawn
    assert drawn.ratio == pytest.approx(4.0)
    assert drawn.effect.size == pytest.approx(0.1 * (4 / 1.34) ** (1 / 1.9))
