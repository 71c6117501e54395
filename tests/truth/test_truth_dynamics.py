"""The equations of motion against closed forms, symmetry, limits and an independent simulator."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from truth.campaign.draw import draw_basis
from truth.campaign.file_formats import model_xml
from truth.errors import TruthError
from truth.machine.dynamics import assemble, joint_rows
from truth.machine.mjcf_reader import read_station
from truth.machine.rig import Prepared, accelerance, build
from truth.machine.station import Hammer, Sensor, Station

FREQ = np.linspace(0, 200, 41)
OMEGA = 2 * np.pi * FREQ

# Joints that are none of the usual six: skew axes, several places, rigid directions, a weld.
SKEW = """
<mujoco model="skew"><option gravity="0 0 0"/><worldbody>
  <body name="a" pos="0.1 0.2 0.3">
    <inertial pos="0.3 0.1 0" mass="20" diaginertia="1 1.2 1.4"/>
    <joint name="a1" type="slide" axis="1 1 0" pos="0 0 0.1" stiffness="3e6" damping="200"/>
    <joint name="a2" type="slide" axis="1 0 0" pos="0.3 0 0" stiffness="2e6" damping="300"/>
    <joint name="a3" type="hinge" axis="0 1 2" pos="0.4 0.5 0.1" stiffness="8e5" damping="90"/>
    <site name="acc1" pos="0.1 0.3 0.5"/>
    <body name="b" pos="0.5 0 0.2">
      <inertial pos="0.1 0 0.2" mass="7" fullinertia="0.5 0.6 0.4 0.05 -0.02 0.03"/>
      <joint name="b1" axis="1 0 0" pos="0 0.2 0" stiffness="4e4" damping="9"/>
      <joint name="b2" axis="0 1 0.5" pos="0.1 0 0.3" stiffness="6e4" damping="7"/>
      <site name="acc2" pos="0.2 -0.1 0.4"/>
      <body name="c" pos="0 0 0.3">
        <inertial pos="0.02 0.03 0.1" mass="3" diaginertia="0.1 0.1 0.15"/>
        <site name="acc3" pos="0 0.1 0.2"/>
      </body>
    </body>
  </body>
</worldbody></mujoco>
"""


def test_one_body_on_springs_follows_the_closed_form(one_body, hammers_at):
    # Joint at the centre of mass: u_i = f_i / (k_i - m w^2 + i w c_i), nothing mixes.
    stage = one_body.stages[0]
    H = accelerance(build(Prepared(one_body, hammers_at(0, stage.com))), FREQ)
    k = np.array([joint.stiffness for joint in stage.joints[:3]])
    c = np.array([joint.damping for joint in stage.joints[:3]])
    w = OMEGA[:, None]
    expected = -(w**2) / (k - stage.mass * w**2 + 1j * w * c)
    np.testing.assert_allclose(H[:, :3, :], expected[:, None, :] * np.eye(3), rtol=1e-12)


def test_a_point_off_the_centre_also_feels_the_rotation(one_body, hammers_at):
    # At r = 0.5 m along x, hit in y: y/f = 1/(k_y ..) + r^2/(k_rz ..), and -r/(k_rz ..) about z.
    stage = one_body.stages[0]
    H = accelerance(build(Prepared(one_body, hammers_at(0, stage.sensors[1].position))), FREQ)
    ty, rz = stage.joints[1], stage.joints[5]
    translation = ty.stiffness - stage.mass * OMEGA**2 + 1j * OMEGA * ty.damping
    rotation = rz.stiffness - stage.inertia[2, 2] * OMEGA**2 + 1j * OMEGA * rz.damping
    expected = -(OMEGA**2) * (1 / translation + 0.25 / rotation)
    np.testing.assert_allclose(H[:, 4, 1], expected, rtol=1e-12)
    np.testing.assert_allclose(H[:, 1, 1], -(OMEGA**2) / translation, rtol=1e-12)


def test_motion_lags_by_a_quarter_turn_at_resonance(one_body, hammers_at):
    # exp(+i w t): receptance -i / (c w), so accelerance +i w / c.
    stage = one_body.stages[0]
    w = np.sqrt(stage.joints[0].stiffness / stage.mass)
    freq = np.array([w / (2 * np.pi)])
    H = accelerance(build(Prepared(one_body, hammers_at(0, stage.com))), freq)
    np.testing.assert_allclose(H[0, 0, 0], 1j * w / stage.joints[0].damping, rtol=1e-9)


def test_a_chain_along_one_axis_is_the_hand_assembled_one(two_bodies, hammers_at):
    # All on one vertical line, hit along it: the two-mass chain of the textbook.
    lower, upper = two_bodies.stages
    line = upper.com * [1, 1, 0]
    lower = replace(
        lower,
        com=np.add(line, [0, 0, 0.3]),
        joints=tuple(replace(j, position=line) for j in lower.joints),
        sensors=(Sensor(1, np.add(line, [0, 0, 0.2])),),
    )
    joints = tuple(replace(j, position=np.add(line, [0, 0, 0.5])) for j in upper.joints)
    upper = replace(upper, joints=joints, sensors=(Sensor(2, np.add(line, [0, 0, 0.9])),))
    station = replace(two_bodies, stages=(lower, upper))
    H = accelerance(build(Prepared(station, hammers_at(0, lower.com))), FREQ)
    (k1, c1), (k2, c2) = ((s.joints[2].stiffness, s.joints[2].damping) for s in (lower, upper))
    for line_number, w in enumerate(OMEGA):
        s1, s2 = k1 + 1j * w * c1, k2 + 1j * w * c2
        Z = np.array([[s1 + s2 - lower.mass * w**2, -s2], [-s2, s2 - upper.mass * w**2]])
        expected = -(w**2) * np.linalg.solve(Z, [1, 0])
        np.testing.assert_allclose(H[line_number, [2, 5], 2], expected, rtol=1e-10)


def test_matrices_of_two_bodies_are_the_hand_assembled_ones(two_bodies):
    equations = assemble(two_bodies)
    lower, upper = two_bodies.stages
    np.testing.assert_array_equal(np.diag(equations.mass)[:3], 120.0)
    np.testing.assert_array_equal(equations.mass[9:, 9:], upper.inertia)
    # The stretch of the upper springs at their point: u2 + t2 x r2 - u1 - t1 x r1.
    x = np.arange(1.0, 13.0)
    r1, r2 = (upper.joints[0].position - stage.com for stage in (lower, upper))
    stretch = x[6:9] + np.cross(x[9:], r2) - x[:3] - np.cross(x[3:6], r1)
    twist = x[9:] - x[3:6]
    energy = sum(
        joint.stiffness * value**2
        for joints, values in (
            (lower.joints, x[:6]),
            (upper.joints, [*stretch, *twist]),
        )
        for joint, value in zip(joints, values, strict=True)
    )
    np.testing.assert_allclose(x @ equations.stiffness @ x, energy, rtol=1e-13)
    np.testing.assert_allclose(equations.damping, 2e-4 * equations.stiffness, rtol=1e-12)


vectors = arrays(float, 3, elements=st.floats(-1, 1)).filter(lambda v: np.linalg.norm(v) > 0.1)


@given(places=st.tuples(vectors, vectors), directions=st.tuples(vectors, vectors))
def test_force_and_response_may_change_places(two_bodies, places, directions):
    def response(here: int, there: int) -> np.ndarray:
        unit = [d / np.linalg.norm(d) for d in directions]
        axes = np.vstack([unit[here], np.zeros((2, 3))])
        stages = tuple(
            replace(stage, sensors=(Sensor(1, places[here], axes),) if i == here else ())
            for i, stage in enumerate(two_bodies.stages)
        )
        station = replace(two_bodies, stages=stages)
        hammer = Hammer(2, there, places[there], unit[there])
        return accelerance(build(Prepared(station, (hammer,))), FREQ)[:, 0, 0]

    there, back = response(0, 1), response(1, 0)
    np.testing.assert_allclose(there, back, rtol=1e-8, atol=1e-9 * np.abs(there).max())


def test_gain_and_axes_act_on_the_reading(one_body, hammers_at):
    stage = one_body.stages[0]
    axes = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])
    turned = replace(stage.sensors[0], axes=axes, gain=np.array([2.0, 3.0, 5.0]))
    station = replace(one_body, stages=(replace(stage, sensors=(turned,)),))
    hammers = hammers_at(0, np.add(stage.com, [0.1, 0.2, 0.3]))
    plain = accelerance(build(Prepared(one_body, hammers)), FREQ)[:, :3]
    H = accelerance(build(Prepared(station, hammers)), FREQ)
    np.testing.assert_allclose(H[:, 0], 2 * plain[:, 1], rtol=1e-12)
    np.testing.assert_allclose(H[:, 1], 3 * plain[:, 2], rtol=1e-12)
    np.testing.assert_allclose(H[:, 2], 5 * plain[:, 0], rtol=1e-12)


@pytest.mark.parametrize("gone", range(6))
def test_a_direction_without_a_joint_is_the_limit_of_a_stiff_spring(two_bodies, hammers_at, gone):
    lower, upper = two_bodies.stages
    hammers = hammers_at(1, upper.sensors[0].position)

    def with_joints(joints: tuple) -> np.ndarray:
        station = replace(two_bodies, stages=(lower, replace(upper, joints=joints)))
        return accelerance(build(Prepared(station, hammers)), FREQ)

    rigid = with_joints(tuple(j for i, j in enumerate(upper.joints) if i != gone))
    for stiffness in (1e11, 1e12):
        stiff = replace(upper.joints[gone], stiffness=stiffness, damping=0.0)
        limit = with_joints(tuple(stiff if i == gone else j for i, j in enumerate(upper.joints)))
        # The error falls as 1/k; Z of the other springs at 200 Hz is at most some 1e9.
        assert np.abs(limit - rigid).max() < 1e9 / stiffness * np.abs(rigid).max()


@pytest.mark.parametrize("kind", ["station", "skew"])
def test_an_independent_simulator_gives_the_same_accelerance(kind, nominal, hammers_at, tmp_path):
    path = tmp_path / "skew.xml"
    path.write_text(SKEW)
    station = draw_basis(nominal, 5) if kind == "station" else read_station(path)
    node = 11 if kind == "station" else 2
    H = accelerance(build(Prepared(station, hammers_at(*station.aim(node)))), FREQ)
    expected = _accelerance_by_mujoco(station, node)
    np.testing.assert_allclose(H, expected, rtol=1e-6, atol=1e-8 * np.abs(expected).max())


def _accelerance_by_mujoco(station: Station, node: int) -> np.ndarray:
    meshes = {f"meshes/{mesh.file}": mesh.content for mesh in station.meshes}
    model = mujoco.MjModel.from_xml_string(model_xml(station), meshes)
    sensors = [sensor.node for _, sensor in station.sensors()]
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    K = np.diag(np.asarray(model.jnt_stiffness).reshape(model.njnt, -1)[:, 0])
    C = np.diag(np.asarray(model.dof_damping).reshape(model.nv, -1)[:, 0])

    def jacobian(number: int) -> np.ndarray:
        rows = np.zeros((3, model.nv))
        site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, f"acc{number}")
        mujoco.mj_jacSite(model, data, rows, None, site)
        return rows

    L = np.vstack([jacobian(number) for number in sensors])
    P = jacobian(node).T
    lines = [-(w**2) * L @ np.linalg.solve(K - w**2 * M + 1j * w * C, P) for w in OMEGA[1:]]
    return np.array([np.zeros((L.shape[0], 3)), *lines])


def test_two_joints_in_one_direction_are_refused(one_body):
    stage = one_body.stages[0]
    twin = replace(stage.joints[0], name="twin")
    station = replace(one_body, stages=(replace(stage, joints=(*stage.joints[:2], twin)),))
    with pytest.raises(TruthError, match=r"table.*same direction"):
        assemble(station)


def test_the_drawing_reads_back_as_it_was_written(two_bodies, tmp_path: Path, hammers_at):
    (tmp_path / "model.xml").write_text(model_xml(two_bodies))
    again = read_station(tmp_path / "model.xml")
    np.testing.assert_allclose(assemble(again).stiffness, assemble(two_bodies).stiffness, rtol=1e-9)
    np.testing.assert_array_equal(assemble(again).mass, assemble(two_bodies).mass)


def test_rows_of_joints_are_computed_once_and_cannot_be_changed(two_bodies):
    moving, fixed = joint_rows(two_bodies, 1)
    assert joint_rows(two_bodies, 1)[0] is moving
    np.testing.assert_allclose(moving @ moving.T, joint_rows(replace(two_bodies), 1)[0] @ moving.T)
    for rows in (moving, fixed):
        with pytest.raises(ValueError, match="read-only"):
            rows[:] = 0.0
