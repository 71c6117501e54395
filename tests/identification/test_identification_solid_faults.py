"""One fault in a body's sensors: which, where, how large; and what cannot be told apart."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from solid_bodies import FAULTS, Case, Truth, draw, faulty, triaxials

from identification import check_bodies
from identification.words import Campaign, Layout, Tolerance

LINES = 200


def named(found) -> list[tuple[str, str, str | None]]:
    return [(fault.effect, fault.location, fault.dof) for fault in found.faults]


def is_right(found, truth: Truth) -> bool:
    return any((truth.effect, truth.location, dof) in named(found)[:1] for dof in truth.dofs)


def test_one_fault_in_four_triaxials_is_named_with_its_place():
    wrong = []
    for kind in FAULTS:
        case, truth = faulty(kind, 0, lines=LINES)
        (found,) = check_bodies(draw(case))
        if not (is_right(found, truth) and len(found.faults) == 1):
            wrong.append((kind, truth, found.sentence))
    assert not wrong, wrong


def test_one_fault_in_three_triaxials_is_placed_on_its_sensor():
    # Three spare channels: a gain can hide in the tolerances, an angle look like a gain.
    kinds = ["polarity", "misalignment", "channels exchanged", "sensors exchanged", "delay"]
    wrong = []
    for kind in kinds:
        case, truth = faulty(kind, 0, sensors=3, lines=LINES)
        (found,) = check_bodies(draw(case))
        if not found.faults or found.faults[0].location != truth.location:
            wrong.append((kind, truth, found.sentence))
    assert not wrong, wrong


def fault_of(kind: str, seed: int = 11):
    case, truth = faulty(kind, seed, lines=LINES)
    (found,) = check_bodies(draw(case))
    assert is_right(found, truth), found.sentence
    return case, found.faults[0]


def test_a_gain_is_estimated_within_its_tolerance():
    _, fault = fault_of("gain")
    nearest = min((0.65, 0.75, 1.3, 1.4), key=lambda g: abs(g - fault.parameters["gain"]))
    # What is estimated holds the sensor's own 1 % and what the other sensors' errors leave open.
    assert fault.parameters["gain"] == pytest.approx(nearest, rel=0.05)


def test_a_rotation_is_estimated_in_world_axes():
    case = Case(12, lines=LINES)
    rotation = np.array([0.3, -0.2, 0.4])

    def turn(layout):
        axes = layout.axes.copy()
        axes[2] = Rotation.from_rotvec(rotation).as_matrix() @ axes[2]
        return replace(layout, axes=axes)

    (found,) = check_bodies(draw(replace(case, layout_change=turn)))
    assert named(found) == [("sensor_misalignment", "sensor:p0_2", None)]
    # The tolerance of one degree a sensor, its own and what the other three share of theirs.
    np.testing.assert_allclose(found.faults[0].parameters["rotation"], rotation, atol=0.08)


def test_an_offset_is_estimated_in_world_axes():
    case = Case(13, lines=LINES)
    offset = np.array([0.06, -0.09, 0.03])

    def move(layout):
        positions = layout.positions.copy()
        positions[1] += offset
        return replace(layout, positions=positions)

    (found,) = check_bodies(draw(replace(case, layout_change=move)))
    assert named(found) == [("sensor_position", "sensor:p0_1", None)]
    np.testing.assert_allclose(found.faults[0].parameters["offset"], offset, atol=0.03)


@pytest.mark.parametrize(("seed", "noise"), [(0, 0.02), (1, 0.005)])
def test_a_place_far_outside_its_body_is_no_exchange_of_sensors(seed, noise):
    # On its way there from the drawn place a fit took the errors of other sensors along, and three
    # faults of three sensors were left.
    offset = np.array([-0.15, -0.47, -0.09])
    (found,) = check_bodies(in_a_square(seed, offset, noise))
    assert named(found) == [("sensor_position", "sensor:p0_2", None)]
    np.testing.assert_allclose(found.faults[0].parameters["offset"], offset, atol=0.01)


def in_a_square(seed: int, offset: np.ndarray, noise: float) -> Campaign:
    """Four world-aligned triaxials about a small stage, the third somewhere else."""
    exact = Tolerance(
        sensor_gain=1e-6,
        sensor_angle=1e-6,
        sensor_position=1e-6,
        sensor_delay=0,
        sensor_cross=0,
    )
    campaign = draw(Case(seed, lines=LINES, noise=noise, tolerance=exact))
    corners = np.array([[-0.16, -0.14, 0.05], [0.16, -0.14, 0.05], [0.16, 0.14, 0.05]])
    corners = np.vstack([corners, [-0.16, 0.14, 0.05]]) + campaign.layout.centres[0]
    axes = np.tile(np.eye(3), (4, 1, 1))
    square = replace(campaign.layout, positions=corners, axes=axes)
    true = replace(square, positions=corners + offset * (np.arange(4) == 2)[:, None])
    moved = read_at(campaign, true)
    return replace(moved, layout=square, tolerance=Tolerance())


def read_at(campaign: Campaign, layout: Layout) -> Campaign:
    """The same motion of a body, and the same noise, read by sensors elsewhere."""
    rows, old = (one.rows(triaxials(one)) for one in (layout, campaign.layout))
    tests = []
    for test in campaign.tests:
        frf = test.estimate.frf
        motion = np.linalg.pinv(old) @ frf.values
        values = rows @ motion + (frf.values - old @ motion)
        tests.append(
            replace(test, estimate=replace(test.estimate, frf=replace(frf, values=values)))
        )
    return replace(campaign, layout=layout, tests=tuple(tests))


@pytest.mark.parametrize("turns", [-0.9, 1.7])
def test_a_delay_is_estimated_though_the_phase_turns_along_the_band(turns):
    case = Case(14, lines=LINES)
    delay = turns / float(draw(case).freq_hz[-1])

    def late(freq, values):
        values = values.copy()
        values[:, 3:6] *= np.exp(-2j * np.pi * freq * delay)[:, None, None]
        return values

    (found,) = check_bodies(draw(replace(case, read=late)))
    assert named(found) == [("sensor_delay", "sensor:p0_1", None)]
    assert found.faults[0].parameters["delay"] == pytest.approx(delay, rel=0.03)


def test_a_mount_above_the_band_is_estimated():
    (found,) = check_bodies(draw(Case(15, lines=LINES, read=loose(420.0, 0.04))))
    assert named(found) == [("mount_resonance", "sensor:p0_1", None)]
    assert found.faults[0].parameters["frequency"] == pytest.approx(420, rel=0.05)


def loose(frequency: float, damping: float):
    """A seismic mass m on k and c, read: X / Y = (k + i w c) / (k + i w c - m w^2)."""
    mass = 0.013
    stiffness = mass * (2 * np.pi * frequency) ** 2
    damper = 2 * damping * np.sqrt(mass * stiffness)

    def read(freq, values):
        omega = 2 * np.pi * freq
        carried = stiffness + 1j * omega * damper
        values = values.copy()
        values[:, 3:6] *= (carried / (carried - mass * omega**2))[:, None, None]
        return values

    return read


def test_a_mount_in_the_band_is_sized_by_its_own_law():
    # Without the damper's part of what carries, 6 % of damping came out as 5.6 %, and the rest as
    # faults of other sensors.
    (found,) = check_bodies(draw(Case(15, lines=LINES, noise=0.005, read=loose(110.0, 0.06))))
    assert named(found) == [("mount_resonance", "sensor:p0_1", None)]
    parameters = found.faults[0].parameters
    assert parameters["frequency"] == pytest.approx(110, rel=0.003)
    assert parameters["damping"] == pytest.approx(0.06, rel=0.02)


def test_two_faults_are_taken_out_one_after_the_other():
    def both(freq, values):
        values = values.copy()
        values[:, 1] *= -1
        values[:, 6] *= 1.4
        return values

    (found,) = check_bodies(draw(Case(16, sensors=5, lines=LINES, read=both)))
    wanted = {("sensor_polarity", "sensor:p0_0", "ty"), ("sensor_gain", "sensor:p0_2", "tx")}
    assert set(named(found)) == wanted, found.sentence
    assert not found.has_unexplained


def test_two_sensors_of_different_bodies_exchanged_are_found_on_both():
    campaign = draw(Case(17, sensors=3, bodies=2, lines=LINES, read=exchange))
    first, second = check_bodies(campaign)
    for found in (first, second):
        assert named(found) == [("sensor_swap", "sensor:p0_1+p1_1", None)], found.sentence
        assert found.solid_to_hz == found.freq_hz[-1]


def exchange(_, values):
    return values[:, [*range(3), *range(12, 15), *range(6, 12), *range(3, 6), *range(15, 18)]]


def test_a_fault_leaves_the_other_bodies_alone():
    def flip(freq, values):
        values = values.copy()
        values[:, 14] *= -1
        return values

    campaign = draw(Case(18, bodies=2, lines=LINES, read=flip))
    first, second = check_bodies(campaign)
    assert not first.faults
    assert named(second) == [("sensor_polarity", "sensor:p1_0", "tz")]


def renamed(campaign: Campaign, names: dict[str, str]) -> Campaign:
    """The same campaign with sensors called otherwise."""
    layout = replace(
        campaign.layout, points=tuple(names[point] for point in campaign.layout.points)
    )
    tests = []
    for test in campaign.tests:
        frf = test.estimate.frf
        outputs = tuple(replace(dof, point=names[dof.point]) for dof in frf.outputs)
        estimate = replace(test.estimate, frf=replace(frf, outputs=outputs))
        tests.append(replace(test, estimate=estimate))
    return replace(campaign, layout=layout, tests=tuple(tests))


def test_the_fault_follows_the_sensors_name():
    case, truth = faulty("polarity", 21, lines=LINES)
    names = {f"p0_{k}": f"acc{9 - k}" for k in range(4)}
    (found,) = check_bodies(renamed(draw(case), names))
    old = truth.location.split(":")[1]
    assert found.faults[0].location == f"sensor:{names[old]}"


def in_a_plane(seed: int) -> Campaign:
    """Three world-aligned triaxials at one height, as on a spindle."""
    campaign = draw(Case(seed, sensors=3, lines=LINES, read=lambda freq, values: values))
    layout = campaign.layout
    height = np.where(np.arange(3) == 2, layout.centres[0, 2] - 0.014, layout.positions)
    return read_at(campaign, replace(layout, positions=height, axes=np.tile(np.eye(3), (3, 1, 1))))


def test_three_triaxials_in_a_plane_do_not_see_their_gains_across_it():
    # Three channels across the plane determine tz, rx and ry; no other channel sees these three.
    (found,) = check_bodies(in_a_plane(22))
    across = {f"sensor_gain@sensor:p0_{k}:tz" for k in range(3)}
    assert across <= set(found.unidentifiable)
    assert not {f"sensor_gain@sensor:p0_{k}:{d}" for k in range(3) for d in ("tx", "ty")} & set(
        found.unidentifiable
    )
    assert "faults that these channels cannot show" in found.sentence


def test_an_angle_in_the_plane_and_a_gain_of_it_are_not_called_twins_of_four_triaxials():
    (found,) = check_bodies(draw(Case(22, lines=LINES)))
    assert not found.confounded
    assert not found.unidentifiable


def test_every_channel_of_a_campaign_has_its_own_label():
    campaign = draw(Case(23, lines=LINES))
    (found,) = check_bodies(campaign)
    assert found.channels == tuple(triaxials(campaign.layout))


def test_results_are_read_only():
    (found,) = check_bodies(draw(Case(24, lines=60)))
    with pytest.raises(ValueError, match="read-only"):
        found.deviation[0] = 1.0
