"""Effects inside the measurement: what sensors read and where the hammer points."""

from dataclasses import replace

import numpy as np
import pytest
from effect_rigs import FREQ, OCCASIONS, chain, frf_of, machine_of, random_of, scene_of

from truth.effects import Scene
from truth.effects.hammer_errors import (
    HammerDelay,
    HammerGain,
    HammerMisalignment,
    HammerPosition,
    draw_hammer_misalignment,
)
from truth.effects.sensor_errors import (
    MountResonance,
    SensorDelay,
    SensorGain,
    SensorMisalignment,
    SensorPolarity,
    SensorPosition,
    SensorSwap,
    draw_mount_resonance,
    draw_sensor_gain,
    draw_sensor_swap,
)
from truth.effects.sensors import outputs
from truth.errors import TruthError
from truth.machine.station import HitPoint

S = 2j * np.pi * FREQ
NODE = 6  # the second sensor of the arm, rows 15 to 17
ROWS = [15, 16, 17]
OTHERS = [row for row in range(36) if row not in ROWS]


def both(effect):
    """FRFs without and with the effect, all other sensors being left alone."""
    plain, found = frf_of(chain()), frf_of(chain(), effect)
    np.testing.assert_allclose(found[:, OTHERS], plain[:, OTHERS], rtol=1e-12)
    return plain[:, ROWS], found[:, ROWS]


def test_the_rows_of_a_sensor_follow_the_order_of_the_station():
    assert list(outputs(chain(), NODE)) == ROWS
    backwards = replace(chain().stages[1], sensors=chain().stages[1].sensors[::-1])
    station = replace(chain(), stages=(chain().stages[0], backwards, chain().stages[2]))
    assert outputs(station, NODE) == (18, 19, 20)


@pytest.mark.parametrize(("sign", "gain"), [(1, 1.3), (-1, 0.7)])
def test_a_wrong_gain_scales_one_direction(sign, gain):
    plain, found = both(SensorGain(NODE, 1, sign, size=0.3))
    np.testing.assert_allclose(found, plain * np.array([1.0, gain, 1.0])[:, None], rtol=1e-12)
    assert SensorGain(NODE, 1, sign, size=0.3).answer().parameters == {"gain": pytest.approx(gain)}


@pytest.mark.parametrize(("sign", "gain"), [(1, 1.1), (-1, 0.9)])
def test_a_wrong_force_channel_scales_all_frfs(sign, gain):
    effect = HammerGain("acc1", sign, size=0.1)
    np.testing.assert_allclose(frf_of(chain(), effect), gain * frf_of(chain()), rtol=1e-12)
    assert effect.answer().parameters == {"gain": pytest.approx(gain)}


def test_a_force_channel_that_lags_advances_all_frfs():
    effect = HammerDelay("acc1", -1, size=2e-4)
    found = frf_of(chain(), effect)
    np.testing.assert_allclose(found, np.exp(2e-4 * S)[:, None, None] * frf_of(chain()), rtol=1e-12)
    assert effect.answer().parameters == {"delay": -2e-4}


def test_a_displaced_hit_turns_the_body_too():
    tested = machine_of(chain(), [])
    node = tested.hammers[0].node
    effect = HammerPosition(size=0.02, along=(0.0, 1.0, 0.0), node=node, site=f"acc{node}")
    moved = machine_of(chain(), [effect])
    for before, after in zip(tested.hammers, moved.hammers, strict=True):
        shift = [0.0, 0.02, 0.0] if before.node == node else [0.0] * 3
        np.testing.assert_allclose(after.position - before.position, shift, atol=1e-15)


def test_a_gain_comes_on_top_of_the_tolerance():
    def off(sensor):
        return replace(sensor, gain=np.array([1.01, 0.98, 1.02]))

    stages = tuple(
        replace(stage, sensors=tuple(map(off, stage.sensors))) for stage in chain().stages
    )
    station = replace(chain(), stages=stages)
    tested = machine_of(station, [SensorGain(NODE, 2, 1, size=0.5), SensorPolarity(NODE, 0)])
    np.testing.assert_allclose(tested.station.stages[1].sensors[1].gain, [-1.01, 0.98, 1.53])


def test_gains_go_both_ways_in_all_directions():
    drawn = [draw_sensor_gain(random_of(s), scene_of(chain()), None) for s in range(60)]
    assert {(one.axis, one.sign) for one in drawn} == {(a, s) for a in range(3) for s in (1, -1)}
    with pytest.raises(TruthError, match="make no sense"):
        SensorGain(NODE, 0, -1, size=1.2)
    with pytest.raises(TruthError, match="make no sense"):
        SensorGain(NODE, 3, -1, size=0.2)


def test_a_wrong_polarity_flips_one_direction():
    plain, found = both(SensorPolarity(NODE, 2))
    np.testing.assert_array_equal(found, plain * np.array([1, 1, -1])[:, None])


def test_a_sensor_turned_a_quarter_about_z_reads_y_as_x():
    effect = SensorMisalignment(NODE, along=(0.0, 0.0, 1.0), size=np.pi / 2)
    plain, found = both(effect)
    scale = np.abs(plain).max()
    np.testing.assert_allclose(found[:, 0], plain[:, 1], atol=1e-12 * scale)
    np.testing.assert_allclose(found[:, 1], -plain[:, 0], atol=1e-12 * scale)
    np.testing.assert_allclose(found[:, 2], plain[:, 2], atol=1e-12 * scale)
    assert effect.answer().parameters == {"rotation": (0.0, 0.0, pytest.approx(np.pi / 2))}


def test_a_slight_turn_adds_the_cross_product():
    # An axis d becomes d + phi x d: it reads d . a + (phi x d) . a = (a - phi x a) . d.
    phi = 1e-6 * np.array([2.0, -1.0, 2.0]) / 3
    plain, found = both(SensorMisalignment(NODE, along=tuple(phi / 1e-6), size=1e-6))
    expected = -np.cross(phi, plain, axisb=1, axisc=1)
    np.testing.assert_allclose(found - plain, expected, atol=1e-11 * np.abs(plain).max())


def test_a_sensor_elsewhere_reads_the_bodys_rotation_too():
    # The same as a sensor that is drawn there: the body turns, a + alpha x offset.
    effect = SensorPosition(NODE, along=(0.6, -0.8, 0.0), size=0.1)
    plain, found = both(effect)
    arm = chain().stages[1]
    sensors = list(arm.sensors)
    sensors[1] = replace(sensors[1], position=sensors[1].position + np.array([0.06, -0.08, 0.0]))
    moved = replace(arm, sensors=tuple(sensors))
    expected = frf_of(replace(chain(), stages=(chain().stages[0], moved, chain().stages[2])))
    np.testing.assert_allclose(found, expected[:, ROWS], rtol=1e-12)
    assert np.linalg.norm(found - plain) > 1e-2 * np.linalg.norm(plain)
    assert effect.answer().parameters == {"offset": pytest.approx((0.06, -0.08, 0.0))}


def test_the_hammer_hits_where_it_did_when_a_sensor_is_elsewhere():
    effect = SensorPosition(1, along=(1.0, 0.0, 0.0), size=0.1)
    tested = machine_of(chain(), [effect])
    assert tested.station.stages[0].sensors[0].position[0] == pytest.approx(0.4)
    assert {float(hammer.position[0]) for hammer in tested.hammers} == {0.3}


def test_a_late_sensor_turns_the_phase_of_its_three_readings():
    effect = SensorDelay(NODE, size=3e-4)
    plain, found = both(effect)
    np.testing.assert_allclose(found, plain * np.exp(-S * 3e-4)[:, None, None], rtol=1e-12)
    assert effect.answer().parameters == {"delay": 3e-4}


def test_a_mounted_sensor_is_a_mass_on_a_spring():
    # m x'' = c (u' - x') + k (u - x), at 125 Hz with 4 %: the seismic mass of the textbook.
    effect = MountResonance(NODE, 0.04, size=(100 / 125) ** 2)
    plain, found = both(effect)
    m, w0 = 0.02, 2 * np.pi * 125
    c, k = 2 * 0.04 * m * w0, m * w0**2
    follows = (k + c * S) / (m * S**2 + c * S + k)
    np.testing.assert_allclose(found, plain * follows[:, None, None], rtol=1e-11)
    assert effect.answer().parameters == {"frequency": pytest.approx(125.0), "damping": 0.04}


def test_mounts_are_from_80_hz_to_5_khz_and_damped():
    low, high = MountResonance(NODE, 0.04, size=0.1).limits
    soft, hard = (MountResonance(NODE, 0.04, size=size) for size in (high, low))
    assert (soft.frequency, hard.frequency) == (pytest.approx(80.0), pytest.approx(5000.0))
    drawn = [draw_mount_resonance(random_of(s), scene_of(chain()), None) for s in range(60)]
    assert all(0.01 <= one.damping <= 0.1 for one in drawn)
    assert all(120 <= one.frequency <= 500 for one in drawn)
    with pytest.raises(TruthError, match="make no sense"):
        MountResonance(NODE, 0.0, size=0.1)


def test_two_channels_of_a_sensor_are_exchanged():
    effect = SensorSwap((NODE,), (0, 2))
    plain, found = both(effect)
    np.testing.assert_array_equal(found, plain[:, [2, 1, 0]])
    answer = effect.answer()
    assert (answer.location, answer.dof) == ("sensor:acc6", "tx+tz")


def test_two_sensors_are_exchanged():
    effect = SensorSwap((3, NODE))
    plain, found = frf_of(chain()), frf_of(chain(), effect)
    order = np.arange(36)
    order[6:9], order[15:18] = np.arange(15, 18), np.arange(6, 9)
    np.testing.assert_array_equal(found, plain[:, order])
    answer = effect.answer()
    assert (answer.location, answer.dof) == ("sensor:acc3+acc6", "")


@pytest.mark.parametrize(
    ("swap", "seen"),
    [
        (SensorSwap((3, NODE)), [6, 7, 8]),
        (SensorSwap((NODE,), (1, 2)), [15, 17, 16]),
    ],
)
def test_what_a_sensor_does_goes_with_its_cable(swap, seen):
    delay, mount = SensorDelay(NODE, size=2e-4), MountResonance(3, 0.02, size=0.3)
    late = frf_of(chain(), delay, mount)
    np.testing.assert_array_equal(frf_of(chain(), delay, mount, swap)[:, ROWS], late[:, seen])
    np.testing.assert_array_equal(frf_of(chain(), delay, mount, swap, swap), late)


def test_a_swap_is_of_channels_as_often_as_of_sensors():
    drawn = [draw_sensor_swap(random_of(s), scene_of(chain()), None) for s in range(100)]
    single = [one for one in drawn if len(one.nodes) == 1]
    assert 30 < len(single) < 70
    assert {one.axes for one in single} == {(0, 1), (0, 2), (1, 2)}
    assert all(one.nodes[0] < one.nodes[1] for one in drawn if len(one.nodes) == 2)
    pair = draw_sensor_swap(random_of(1), scene_of(chain()), "sensor:acc2+acc9")
    assert (pair.nodes, pair.axes) == ((2, 9), ())


def test_an_askew_hammer_mixes_the_columns_of_its_direction_alone():
    effect = HammerMisalignment(1, "acc1", 1, along=(0.6, 0.0, 0.8), size=0.3)
    plain, found = frf_of(chain()), frf_of(chain(), effect)
    # R e_y by Rodrigues' formula: cos e_y + sin (v x e_y), v at right angles to e_y.
    direction = np.cos(0.3) * np.eye(3)[1] + np.sin(0.3) * np.cross(effect.along, np.eye(3)[1])
    np.testing.assert_allclose(found[:, :, 1], plain @ direction, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(found[:, :, [0, 2]], plain[:, :, [0, 2]])
    assert effect.answer().parameters == {"rotation": pytest.approx((0.18, 0.0, 0.24))}


def test_the_hammer_is_named_by_its_site_and_hits_where_the_campaign_does():
    arm = replace(chain().stages[1], hit_points=(HitPoint(40, np.array([0.1, 0.2, 0.6])),))
    station = replace(chain(), stages=(chain().stages[0], arm, chain().stages[2]))
    occasions = tuple(replace(one, node=node) for node in (40, 7) for one in OCCASIONS)
    drawn = [
        draw_hammer_misalignment(random_of(s), Scene(station, occasions), None) for s in range(60)
    ]
    assert {(one.site, one.node) for one in drawn} == {("hit40", 40), ("acc7", 7)}
    assert {one.axis for one in drawn} == {0, 1, 2}
    for one in drawn:
        assert one.along[one.axis] == pytest.approx(0, abs=1e-12)
        assert np.linalg.norm(one.along) == pytest.approx(1)


def test_the_second_point_of_two_is_turned_where_it_is_meant():
    tested = machine_of(chain(), node=5)
    tested = replace(tested, hammers=(*machine_of(chain(), node=1).hammers, *tested.hammers))
    effect = HammerMisalignment(5, "acc5", 2, along=(1.0, 0.0, 0.0), size=0.2)
    turned = effect.to_machine(tested, OCCASIONS[0])
    moved = [a is not b for a, b in zip(turned.hammers, tested.hammers, strict=True)]
    assert moved == [False] * 5 + [True]
    np.testing.assert_allclose(turned.hammers[5].direction, [0, -np.sin(0.2), np.cos(0.2)])
