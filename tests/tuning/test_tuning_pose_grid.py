"""A machine over poses and spin rates: against separate models at each, and their margins."""

import numpy as np
import pytest
from closed_machines import hexapod, linkage, platform_points
from scipy.spatial.transform import Rotation

import mbworkbench as mb
from identification.words import DIRECTIONS, InputError
from mbmodel import as_drawn, load_machine, model_modes
from tuning.control_loops.stability import growing_pole
from tuning.plant.error_budget.loop_plant import LoopPlant
from tuning.plant.error_budget.read_definition import read_definition
from tuning.plant.pose_grid import GridPoint, GridRequest, follow_modes, pose_grid

ARM = """
<mujoco model="arm"><option gravity="0 0 0"/><worldbody>
  <body name="base"><inertial pos="0 0 0" mass="40" diaginertia="2 3 4"/>
    <joint name="base_ty" type="slide" axis="0 1 0" stiffness="2e6" damping="300"/>
    <joint name="base_rz" type="hinge" axis="0 0 1" stiffness="4e5" damping="60"/>
    <site name="acc1" pos="0.1 0 0"/>
    <body name="cart" pos="{place} 0 0"><inertial pos="0 0.02 0.1" mass="12" diaginertia="1 2 3"/>
      <joint name="cart_tx" type="slide" axis="1 0 0" stiffness="3e5" damping="150"
        limited="true" range="-0.4 0.4"/>
      <site name="acc2" pos="0.05 0 0.1"/>
      <body name="rotor"><inertial pos="0 0 0.3" mass="3" diaginertia="0.05 0.05 0.08"/>
        <joint name="rotor_rx" type="hinge" axis="1 0 0" stiffness="9e3" damping="1"/>
        <joint name="rotor_ry" type="hinge" axis="0 1 0" stiffness="8e3" damping="1"/>
        <joint name="rotor_rz" type="hinge" axis="0 0 1" damping="0.001"/>
      </body></body></body></worldbody>
  <actuator><motor name="drive" site="acc2" gear="0 1 0 0 0 0" refsite="acc1"/></actuator>
</mujoco>
"""
BUDGET = """
band = [1, 100]
[error.y]
output = "acc2:+ty"
[noise.n]
loop = "y"
density = 1.0
unit = "nm/sqrt(Hz)"
[loop.y]
input = "acc2:+ty"
output = "acc2:+ty"
controller = {{ poles = [-600.0], gain = {gain} }}
"""
POINTS = [
    GridPoint({"cart_tx": place}, {"rotor_rz": rate})
    for place in (-0.3, 0.05, 0.3)
    for rate in (0, 150)
]
FREQ_HZ = np.geomspace(2.0, 150.0, 40)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    place = tmp_path_factory.mktemp("arm")
    (place / "arm.xml").write_text(ARM.format(place=0))
    (place / "budget.toml").write_text(BUDGET.format(gain=4e7))
    return place


@pytest.fixture(scope="module")
def grid(place):
    request = GridRequest(
        ("acc2:+ty", "acc1:+ty"), ("acc2:+ty",), FREQ_HZ, "receptance", place / "budget.toml"
    )
    return pose_grid(place / "arm.xml", POINTS, request)


@pytest.mark.parametrize("number", range(len(POINTS)))
def test_each_pose_is_that_of_a_separate_model(place, grid, number):
    point = POINTS[number]
    file = place / f"arm{number}.xml"
    file.write_text(ARM.format(place=point.pose["cart_tx"]))
    machine = load_machine(file, point.spin)
    model = as_drawn(machine)
    modes = model_modes(model, model.drawn)
    np.testing.assert_allclose(
        np.sort(grid.freq_hz[number]), np.sort(modes.freq_hz[modes.oscillates]), rtol=1e-9
    )
    exact = mb.read_model(file, point.spin).frf(
        ["acc2:+ty", "acc1:+ty"], "acc2:+ty", FREQ_HZ, "receptance"
    )
    np.testing.assert_allclose(grid.frfs[number], exact.values, rtol=1e-8)
    system = grid.to_control()[number]
    np.testing.assert_allclose(
        system(2j * np.pi * FREQ_HZ).transpose(2, 0, 1), exact.values, rtol=1e-6
    )
    definition = read_definition(place / "budget.toml", machine)
    plant = LoopPlant.of(model, definition)
    closed = plant.poles(model.drawn, is_closed=True)
    pole = growing_pole(closed)
    assert (grid.margins[number] is None) == (pole is not None)
    if pole is None:
        margins = plant.margins(model.drawn, plant.poles(model.drawn, is_closed=False), closed)
        stated = grid.margins[number].loops[0]
        assert stated.modulus.value == pytest.approx(margins.loops[0].modulus.value, rel=1e-7)
        assert stated.phase.value == pytest.approx(margins.loops[0].phase.value, rel=1e-7)
    else:
        assert grid.growing[number] == pytest.approx(pole, rel=1e-6)


def test_the_worst_pose_has_the_smallest_margin_or_grows_fastest(place):
    for gain in (4e5, 4e9):
        (place / "other.toml").write_text(BUDGET.format(gain=gain))
        result = pose_grid(place / "arm.xml", POINTS, GridRequest(budget=place / "other.toml"))
        growth = [0.0 if pole is None else pole.real for pole in result.growing]
        if any(growth):
            assert growth[result.worst] == max(growth)
        else:
            assert result.modulus[result.worst] == result.modulus.min()
        assert any(growth) == (gain > 1e9)


def test_a_mode_keeps_its_column_where_frequencies_cross(tmp_path):
    models = []
    for number, stiffness in enumerate((1e4, 1.5e4, 2.5e4, 4e4)):
        file = tmp_path / f"pair{number}.xml"
        file.write_text(
            '<mujoco><option gravity="0 0 0"/><worldbody>'
            '<body name="a"><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>'
            '<joint name="a_tx" type="slide" axis="1 0 0" stiffness="4e4" damping="3"/></body>'
            '<body name="b"><inertial pos="0 1 0" mass="2" diaginertia="1 1 1"/><joint name="b_tx" '
            f'type="slide" axis="1 0 0" stiffness="{2 * stiffness}" damping="3"/></body>'
            "</worldbody></mujoco>"
        )
        models.append(as_drawn(load_machine(file)))
    frequencies = np.sort(np.abs(follow_modes(models)) / (2 * np.pi), axis=1)
    followed = np.abs(follow_modes(models)) / (2 * np.pi)
    constant = np.sqrt(4e4 / 2) / (2 * np.pi)
    columns = np.isclose(followed, constant, rtol=1e-3).all(axis=0)
    assert columns.sum() == 1
    assert not np.isclose(frequencies, constant, rtol=1e-3).all(axis=0).any()  # sorted ones jump


def test_a_pose_beyond_the_stroke_is_refused(place):
    with pytest.raises(InputError, match="beyond the joint's range"):
        mb.predict_poses(place / "arm.xml", [{"cart_tx": 0.5}])
    assert "2 points" in repr(
        mb.predict_poses(place / "arm.xml", [{"cart_tx": x} for x in (0, 0.1)])
    )


@pytest.mark.parametrize("move", [0.0, 0.02])
def test_a_machine_that_sags_has_poses(tmp_path, move):
    text = ARM.replace('gravity="0 0 0"', 'gravity="-9.81 0 0"')
    (tmp_path / "drawn.xml").write_text(text.format(place=0))
    (tmp_path / "there.xml").write_text(text.format(place=move))
    posed = load_machine(tmp_path / "drawn.xml", pose={"cart_tx": move})
    there = load_machine(tmp_path / "there.xml")
    np.testing.assert_allclose(posed.layout.centres, there.layout.centres, atol=1e-12)


PLATFORM = {"platform_tx": 0.02, "platform_tz": -0.01, "platform_rx": 0.1, "platform_rz": -0.2}


def test_legs_follow_a_platform_as_in_a_separate_model(tmp_path):
    drawn, there = tmp_path / "drawn.xml", tmp_path / "there.xml"
    drawn.write_text(hexapod())
    there.write_text(hexapod(pose=[PLATFORM.get(f"platform_{d}", 0.0) for d in DIRECTIONS]))
    ports = ("acc1:+tx", "joint:strut2", "joint:foot3_x"), ("motor1", "acc2:+tz"), FREQ_HZ
    points = [GridPoint(dict.fromkeys(PLATFORM, 0.0)), GridPoint(PLATFORM)]
    grid = pose_grid(drawn, points, GridRequest(*ports, "receptance"))
    for number, path in enumerate((drawn, there)):
        model = as_drawn(load_machine(path))
        modes = model_modes(model, model.drawn)
        np.testing.assert_allclose(
            np.sort(grid.freq_hz[number]), np.sort(modes.freq_hz[modes.oscillates]), rtol=1e-8
        )
        exact = mb.read_model(path).frf(*ports, "receptance").values
        np.testing.assert_allclose(
            grid.frfs[number], exact, rtol=1e-7, atol=1e-9 * np.abs(exact).max()
        )


def test_a_platform_follows_the_stroke_of_its_struts(tmp_path):
    drawn = tmp_path / "drawn.xml"
    drawn.write_text(hexapod(gravity=0.0, foot_stiffness=0.0))
    pose = np.array([0.02, 0.005, -0.01, 0.1, 0.05, -0.2])
    (tmp_path / "there.xml").write_text(hexapod(gravity=0.0, foot_stiffness=0.0, pose=pose))
    lower, upper = platform_points()
    turned = Rotation.from_euler("XYZ", pose[3:])
    heads = turned.apply(upper - [0, 0, 0.18]) + np.array([0, 0, 0.18]) + pose[:3]
    strokes = np.linalg.norm(heads - lower, axis=1) - np.linalg.norm(upper - lower, axis=1)
    legs = {f"strut{k + 1}": stroke for k, stroke in enumerate(strokes)}
    machine, there = load_machine(drawn, pose=legs), load_machine(tmp_path / "there.xml")
    np.testing.assert_allclose(machine.layout.centres, there.layout.centres, atol=1e-9)
    frequencies = [
        model_modes(as_drawn(each), as_drawn(each).drawn).freq_hz for each in (machine, there)
    ]
    np.testing.assert_allclose(*frequencies, rtol=1e-7)
    lone = load_machine(drawn, pose={"strut1": 2e-3})  # the other struts keep their length
    struts = [lone.layout.bodies.index(f"strut{k}") for k in range(1, 7)]
    reach = np.linalg.norm(lone.layout.centres[struts] - lower, axis=1)
    drawn_reach = 0.75 * np.linalg.norm(upper - lower, axis=1)
    np.testing.assert_allclose(reach - drawn_reach, [2e-3, 0, 0, 0, 0, 0], atol=1e-9)


def test_a_pose_that_a_chain_does_not_reach_is_refused(tmp_path):
    (tmp_path / "linkage.xml").write_text(linkage(gravity=0.0))
    with pytest.raises(InputError, match="rocker = 2 cannot be reached, because the chain of"):
        load_machine(tmp_path / "linkage.xml", pose={"rocker": 2.0})
