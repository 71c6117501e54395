"""A machine over poses and spin rates: against separate models at each, and their margins."""

import numpy as np
import pytest

import mbworkbench as mb
from identification.words import InputError
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
