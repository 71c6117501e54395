"""Effects of bodies against closed forms: added mass, bending, a rotor."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from effect_rigs import FREQ, chain, frf_of, machine_of, random_of, rig_of, scene_of
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from truth.effects.body_errors import (
    Appendage,
    Gyroscopic,
    MassError,
    draw_gyroscopic,
    draw_mass_error,
)
from truth.effects.flexible_body import FlexibleBody, bend_of, draw_flexible_body
from truth.errors import TruthError
from truth.machine.rig import receptance
from truth.machine.station import GROUND, Joint, Sensor, StageBody, Station

W = 2 * np.pi * FREQ
NUMBERS = st.floats(-1, 1)


def test_an_added_mass_is_a_small_body_welded_on(two_bodies):
    position = np.array([0.2, -0.1, 0.3])
    effect = MassError(body="table", body_mass=120.0, position=tuple(position), size=0.15)
    speck = StageBody(
        name="speck",
        parent=0,
        mass=18.0,
        com=two_bodies.stages[0].com + position,
        inertia=1e-9 * np.eye(3),
    )
    welded = replace(two_bodies, stages=(*two_bodies.stages, speck))
    np.testing.assert_allclose(frf_of(two_bodies, effect), frf_of(welded), rtol=1e-7)
    assert effect.answer().parameters == {"mass": 18.0, "position": tuple(position)}


@given(st.tuples(NUMBERS, NUMBERS, NUMBERS), st.floats(1e-3, 1))
def test_an_added_mass_keeps_the_moments_about_any_point(position, size):
    # Second moments about the body's old centre of mass grow by m p p^T, whatever the new one.
    before = chain()
    effect = MassError(body="arm", body_mass=60.0, position=position, size=size)
    old = before.stages[1]
    tested = machine_of(before, [effect])
    new = tested.station.stages[1]
    away = new.com - old.com
    about = new.inertia + new.mass * (away @ away * np.eye(3) - np.outer(away, away))
    p = np.array(position)
    expected = old.inertia + 60 * size * (p @ p * np.eye(3) - np.outer(p, p))
    np.testing.assert_allclose(about, expected, rtol=1e-9, atol=1e-9)
    assert new.mass == pytest.approx(60 * (1 + size))
    others = [number for number in range(3) if number != 1]
    assert all(tested.station.stages[i] is before.stages[i] for i in others)


def test_a_forgotten_mass_lies_within_the_reach_of_the_body():
    # Radii of gyration 0.283 m: the arms, up to 0.3, 0.25, 0.12 m, are within 0.3 and 1.5 of it.
    station = chain()
    drawn = [draw_mass_error(random_of(s), scene_of(station), "body:arm") for s in range(200)]
    away = np.array([one.position for one in drawn])
    reach = np.array([0.3, 0.25, 0.12])
    assert (np.abs(away) <= reach).all()
    assert (away.max(axis=0) > 0.9 * reach).all()
    assert (away.min(axis=0) < -0.9 * reach).all()


@pytest.mark.parametrize(("arm", "reach"), [(0.0, 0.3), (5.0, 1.5)])
def test_the_reach_of_a_body_is_bounded_by_its_radius_of_gyration(arm, reach):
    # A mean square distance of 1 m^2 from the centre of mass: trace I = 2 m.
    stage = chain().stages[0]
    sensor = replace(stage.sensors[0], position=stage.com + arm)
    inertia = stage.mass * np.diag([0.6, 0.6, 0.8])
    station = Station("ball", (replace(stage, inertia=inertia, sensors=(sensor,)),))
    drawn = [draw_mass_error(random_of(s), scene_of(station), None).position for s in range(99)]
    assert 0.95 * reach < np.abs(drawn).max() <= reach


def test_an_appendage_hangs_on_the_bent_body():
    station = chain()
    bend = FlexibleBody("arm", (1.0, 0.0, 0.0), frequency=80.0, damping=0.01, size=0.5)
    load = Appendage("arm", 60.0, 2, frequency=60.0, damping=0.02, size=0.1)
    rig = rig_of(station, [bend, load])
    spring = rig.equations.stiffness[-1]
    shape = bend_of(station, 1, (0.5, 0.0, 0.0))(station.stages[1].com)
    assert abs(shape[2]) > 0.01
    assert spring[18] == pytest.approx(-shape[2] * spring[-1])


def plate() -> Station:
    """A square plate, hung at its centre, with a sensor at each corner and on an edge."""
    com = np.array([0.2, 0.1, 0.3])
    corners = [[1, 1], [-1, 1], [-1, -1], [1, -1]]
    joints = tuple(
        Joint(f"plate_t{axis}", "slide", np.eye(3)["xyz".index(axis)], com, 1e6, 50.0)
        for axis in "xyz"
    )
    sensors = tuple(
        Sensor(number, com + np.array([0.4 * x, 0.4 * y, 0.0]))
        for number, (x, y) in enumerate(corners, start=1)
    )
    stage = StageBody("plate", GROUND, 20.0, com, np.diag([1.0, 1.1, 2.0]), joints, sensors)
    return Station("plate", (stage,))


def test_a_twisting_plate_adds_its_mode_to_the_rigid_motion():
    # At rest at its centre, which alone is held: H gains -w^2 u_i u_j / (M (w0^2 - w^2 + ...)).
    station = plate()
    effect = FlexibleBody("plate", (0.0, 1.0, 0.0), frequency=90.0, damping=0.01, size=0.7)
    w0 = 2 * np.pi * 90.0
    mode = -(W**2) / (20.0 * (w0**2 - W**2 + 2j * 0.01 * w0 * W))
    added = frf_of(station, effect) - frf_of(station)
    np.testing.assert_allclose(added[:, 2, 2], 0.49 * mode, rtol=1e-9)
    np.testing.assert_allclose(added[:, 5, 2], -0.49 * mode, rtol=1e-9)
    np.testing.assert_allclose(added[:, :2], 0, atol=1e-12 * np.abs(mode).max())
    assert effect.answer().parameters == {"frequency": 90.0, "damping": 0.01}


@given(st.tuples(NUMBERS, NUMBERS, NUMBERS), st.integers(0, 2))
def test_a_bending_moves_its_measured_and_held_points_by_no_rigid_motion(bending, index):
    station = chain()
    bend = bend_of(station, index, bending)
    stage = station.stages[index]
    joints = [station.stages[i].joints[0].position for i in (index, index + 1) if i < 3]
    points = np.array([*(sensor.position for sensor in stage.sensors), *joints])
    moved = np.array([bend(point)[:3] for point in points])
    scale = 1e-9
    assert np.abs(moved.sum(axis=0)).max() < scale
    assert np.abs(np.cross(points - stage.com, moved).sum(axis=0)).max() < scale


@given(st.tuples(NUMBERS, NUMBERS, NUMBERS), st.tuples(NUMBERS, NUMBERS, NUMBERS))
def test_the_rotation_of_a_bending_is_half_the_curl_of_its_translation(bending, away):
    bend = bend_of(chain(), 1, bending)
    point, step = chain().stages[1].com + np.array(away), 1e-3
    slopes = np.array(
        [(bend(point + step * e)[:3] - bend(point - step * e)[:3]) / (2 * step) for e in np.eye(3)]
    )
    curl = [slopes[1, 2] - slopes[2, 1], slopes[2, 0] - slopes[0, 2], slopes[0, 1] - slopes[1, 0]]
    np.testing.assert_allclose(bend(point)[3:], np.array(curl) / 2, atol=1e-9)
    assert np.trace(slopes) == pytest.approx(-away[2] * _laplacian(bend), abs=1e-9)


def _laplacian(bend):
    a, _, c = bend.bending
    return 2 * (a + c) / bend.reach**2


def test_a_bent_body_turns_and_moves_its_joints():
    station = chain()
    effect = FlexibleBody("arm", (0.6, 0.5, 0.3), frequency=80.0, damping=0.01, size=1.0)
    rig = rig_of(station, [effect])
    K = rig.equations.stiffness
    bend = bend_of(station, 1, effect.bending)
    expected = 60.0 * (2 * np.pi * 80.0) ** 2
    for index in (1, 2):
        joints = station.stages[index].joints
        moved = bend(joints[0].position)
        expected += sum(
            joint.stiffness * part**2 for joint, part in zip(joints, moved, strict=True)
        )
    assert K[18, 18] == pytest.approx(expected, rel=1e-12)


def test_only_a_body_with_three_sensors_bends(two_bodies):
    assert draw_flexible_body(random_of(1), scene_of(two_bodies), None) is None
    station = chain()
    head = replace(station.stages[2], sensors=station.stages[2].sensors[:2])
    few = scene_of(replace(station, stages=(*station.stages[:2], head)))
    with pytest.raises(TruthError, match=r"body:head.*cannot.*body:base, body:arm"):
        draw_flexible_body(random_of(1), few, "body:head")


def test_encoders_have_no_place_on_a_body():
    """Those of a chain read its joints: with and without them all is drawn alike."""
    station = chain()
    names = [joint.name for stage in station.stages for joint in stage.joints]
    read = station.with_encoders({f"enc_{name}": (name, 0) for name in names})
    for draw in (draw_mass_error, draw_flexible_body):
        for seed in range(5):
            assert draw(random_of(seed), scene_of(read), None) == draw(
                random_of(seed), scene_of(station), None
            )
    bending = (0.5, -0.7, 0.4)
    assert bend_of(read, 1, bending).drift == bend_of(station, 1, bending).drift


def test_a_body_bends_where_encoders_alone_measure():
    station = chain()
    bare = replace(station, stages=tuple(replace(s, sensors=()) for s in station.stages))
    assert draw_flexible_body(random_of(1), scene_of(bare), None) is None
    names = [joint.name for stage in station.stages for joint in stage.joints]
    read = bare.with_encoders({f"enc_{name}": (name, 0) for name in names})
    effect = draw_flexible_body(random_of(1), scene_of(read), "body:arm")
    bend = bend_of(read, 1, effect.bending)
    ends = np.array([read.stages[1].com, *(read.stages[i].joints[0].position for i in (1, 2))])
    assert bend.reach == pytest.approx(np.ptp(ends, axis=0).max() / 2)
    # The joints move by no rigid motion, but each turns: so encoders feel the mode.
    assert max(np.abs(bend(point)[3:]).max() for point in ends[1:]) > 0.1


def rotor(h: float = 40.0) -> Gyroscopic:
    return Gyroscopic("table", 4.0, (0.0, 0.0, 1.0), size=h / 4.0)


def test_a_rotor_couples_the_two_tilts_as_in_the_textbook(one_body):
    # [I_x s^2 + c s + k, h s; -h s, I_y s^2 + c s + k] (theta_x, theta_y) = (tau_x, tau_y)
    rig = rig_of(one_body, [rotor()])
    H = receptance(rig, FREQ, np.eye(6)[:, 3:5])[:, 3:5]
    s = 1j * W
    springs = [
        moment * s**2 + joint.damping * s + joint.stiffness
        for moment, joint in zip([3.0, 4.0], one_body.stages[0].joints[3:5], strict=True)
    ]
    determinant = springs[0] * springs[1] + (40 * s) ** 2
    np.testing.assert_allclose(H[:, 0, 0], springs[1] / determinant, rtol=1e-10)
    np.testing.assert_allclose(H[:, 1, 0], 40 * s / determinant, rtol=1e-10)
    np.testing.assert_allclose(H[:, 0, 1], -40 * s / determinant, rtol=1e-10)


def test_a_rotor_nutates_as_eulers_equations_say(one_body):
    # A free body with a rotor h in its own axes: I w' + w x (I w + h e) = 0, R' = R [w]x.
    inertia, e, h = one_body.stages[0].inertia, np.array([0.0, 0.0, 1.0]), 40.0
    start, end = np.array([1e-6, 2e-6, 0.0]), 0.1

    def rates(_: float, state: np.ndarray) -> np.ndarray:
        w, turned = state[:3], state[3:].reshape(3, 3)
        faster = np.linalg.solve(inertia, np.cross(inertia @ w + h * e, w))
        spin = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        return np.concatenate([faster, (turned @ spin).ravel()])

    run = solve_ivp(rates, (0, end), [*start, *np.eye(3).ravel()], rtol=1e-11, atol=1e-16)
    expected = Rotation.from_matrix(run.y[3:, -1].reshape(3, 3)).as_rotvec()
    rig = rig_of(one_body, [rotor(h)])
    plain = rig_of(one_body)
    C = (rig.equations.damping - plain.equations.damping)[3:, 3:]
    A = np.block([[np.zeros((3, 3)), np.eye(3)], [np.zeros((3, 3)), -np.linalg.solve(inertia, C)]])
    found = scipy.linalg.expm(A * end)[:3, 3:] @ start
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-12)


def test_a_rotor_about_a_skew_axis_leaves_that_axis_alone_and_loses_nothing(two_bodies):
    e = np.array([1.0, 2.0, -2.0]) / 3
    effect = Gyroscopic("holder", 2.0, tuple(e), size=10.0)
    C = rig_of(two_bodies, [effect]).equations.damping - rig_of(two_bodies).equations.damping
    np.testing.assert_allclose(C, -C.T, atol=1e-12)
    np.testing.assert_allclose(C[9:, 9:] @ e, 0, atol=1e-12)
    assert np.linalg.norm(C[9:, 9:]) == pytest.approx(np.sqrt(2) * effect.angular_momentum)
    assert not C[:9].any()
    assert effect.answer().parameters == {"angular_momentum": 20.0}


def test_a_rotor_sits_where_two_tilts_feel_it_on_the_axis_of_a_hinge():
    station = chain(hinges=True)  # the head has rx, ry alone and can feel it through the arm
    drawn = [draw_gyroscopic(random_of(s), scene_of(station), "body:head") for s in range(40)]
    assert {one.axis for one in drawn} == {(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)}
    arm = draw_gyroscopic(random_of(1), scene_of(station), "body:arm")
    assert arm.axis == (0.0, 0.0, 1.0)
    assert arm.moment == pytest.approx(60 * (0.04 + 0.05 + 0.07) / 3)
    upper = chain().stages[2]
    for joints, axes in ((slice(3, 5), {(1, 0, 0), (0, 1, 0)}), (slice(3, 6), {(0, 0, 1)})):
        few = replace(upper, joints=upper.joints[joints])
        scene = scene_of(replace(chain(), stages=(*chain().stages[:2], few)))
        found = {draw_gyroscopic(random_of(s), scene, "body:head").axis for s in range(20)}
        assert found == axes
    base = replace(station.stages[0], joints=station.stages[0].joints[:4])
    assert draw_gyroscopic(random_of(1), scene_of(Station("one", (base,))), None) is None
