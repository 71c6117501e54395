"""Tendons pull at bodies as MuJoCo says, follow joints that move, and are Parts of their own."""

import numpy as np
import pytest
from mbmodel_examples import STATION, mjcf, worst_of_channels
from test_mbmodel_parts import (
    assert_rebuilt_answers_alike,
    differences,
    off,
    sensors,
    size_of,
)
from test_mbmodel_slopes import assert_gradient_is_contraction, worst_column

from identification.words import Dof
from mbmodel import (
    FrfRequest,
    Model,
    as_drawn,
    body_parts,
    joint_parts,
    linearise,
    load_machine,
    spring_parts,
)

LEGS = STATION.with_name("station_legs.xml")


def six(name):
    """Three slides and three hinges through one point."""
    return "".join(
        f'<joint name="{name}_{short}{k}" type="{kind}" axis="{axis}" pos="0.1 0.05 0" '
        f'stiffness="{stiffness}" damping="{stiffness / 1e4}"/>'
        for short, kind, stiffness in (("t", "slide", 2e4), ("r", "hinge", 900))
        for k, axis in enumerate(("1 0 0", "0 1 0", "0 0 1"))
    )


BODIES = "".join(
    f'<body name="{name}" pos="{pos}" quat="{quat}">'
    '<inertial pos="0.02 0.01 -0.03" mass="3" fullinertia="0.11 0.12 0.13 0.001 0.002 0.003"/>'
    f'{six(name)}<site name="{name}_eye" pos="0.05 0.1 0.2"/>'
    f'<site name="{name}_foot" pos="-0.1 0.02 -0.1"/>'
    f'<geom name="{name}_drum" type="cylinder" size="0.06 0.1" pos="0 0.1 0.05" contype="0" '
    'conaffinity="0" mass="0"/>'
    f'<site name="acc{node}" pos="0.1 -0.2 0.3"/></body>'
    for name, pos, quat, node in (
        ("a", "0.4 0 0.3", "1 0.2 0.1 0", 1),
        ("b", "-0.5 0.1 0.4", "1 0 -0.3 0.2", 2),
    )
)
ANCHOR = '<site name="anchor" pos="0 0.6 -0.2"/>'
PATHS = {
    "straight": '<site site="a_eye"/><site site="b_foot"/>',
    "from the floor": '<site site="anchor"/><site site="a_foot"/>',
    "over three": '<site site="anchor"/><site site="a_foot"/><site site="b_eye"/>',
    "round a drum": '<site site="a_eye"/><geom geom="b_drum"/><site site="anchor"/>',
    "by a pulley": (
        '<site site="a_eye"/><site site="b_eye"/><pulley divisor="2"/><site site="b_foot"/>'
        '<site site="anchor"/><pulley divisor="3"/><site site="a_foot"/><site site="anchor"/>'
    ),
}


def two_tied_stages(path, **spring):
    """Two stages on springs and one tendon between them."""
    attributes = {"stiffness": 7e3, "damping": 3, **spring}
    words = " ".join(f'{key}="{value}"' for key, value in attributes.items())
    tendon = f'<tendon><spatial name="t" {words}>{PATHS[path]}</spatial></tendon>'
    return mjcf(ANCHOR + BODIES).replace("</mujoco>", tendon + "</mujoco>")


@pytest.mark.parametrize("path", PATHS)
def test_the_pull_at_bodies_is_mujocos_row_in_joint_coordinates(from_text, path):
    machine = from_text(two_tied_stages(path))
    (spring,) = (s for s in machine.springs if s.name == "t")
    assert np.abs(spring.direction).max() > 0.1
    np.testing.assert_allclose(
        machine.jacobian.T @ spring.at_bodies, spring.direction, rtol=0, atol=1e-12
    )


@pytest.mark.parametrize("path", PATHS)
def test_columns_are_right_where_joints_move_a_tendon(from_text, path):
    machine = from_text(two_tied_stages(path))
    model = Model(machine, spring_parts(machine) + joint_parts(machine))
    theta = off(model, amount=0.5)
    outputs, inputs = sensors(machine)
    frf_request = FrfRequest(np.array([5.0, 13.0, 21.0]), outputs, inputs)
    lines = linearise(model, theta, frf_request)
    sizes = np.array([size_of(parameter) for parameter in model.parameters])
    assert worst_column(
        lines.columns() * sizes, differences(model, theta, frf_request), lines.values
    ) < (1e-6)
    assert_gradient_is_contraction(lines)


@pytest.mark.parametrize("path", PATHS)
def test_a_tendon_follows_joints_that_move(from_text, path, tmp_path):
    machine = from_text(two_tied_stages(path))
    model = Model(machine, spring_parts(machine) + joint_parts(machine) + body_parts(machine))
    assert_rebuilt_answers_alike(model, off(model, amount=0.5), tmp_path, within=1e-9)


@pytest.fixture(scope="module")
def legs():
    return load_machine(LEGS)


def test_six_legs_carry_the_hexapod_alone(legs):
    model = as_drawn(legs)
    locations = [part.location for part in model.parts]
    assert [f"tendon:leg{k}" for k in range(1, 7)] == locations[-6:]
    hexapod = [k for k, name in enumerate(legs.coordinates) if name.startswith("hexapod_")]
    stiffness = model.matrices(model.drawn).stiffness[np.ix_(hexapod, hexapod)]
    springs = [s for s in legs.springs if s.name.startswith("leg")]
    rows = [s.direction[hexapod] for s in springs]
    expected = sum(s.stiffness * np.outer(r, r) for s, r in zip(springs, rows, strict=True))
    np.testing.assert_allclose(stiffness, expected, rtol=1e-12, atol=1e-6 * stiffness.max())
    assert np.linalg.eigvalsh(stiffness).min() > 1e4


def test_legs_joints_and_masses_change_as_the_machine_rebuilt(legs, tmp_path):
    model = Model(legs, spring_parts(legs) + body_parts(legs) + joint_parts(legs))
    assert_rebuilt_answers_alike(model, off(model, amount=0.5), tmp_path, within=1e-9)


def test_columns_by_a_legs_stiffness_and_damping_are_differences(legs):
    model = Model(legs, spring_parts(legs)[-8:])
    whole = Model(legs, spring_parts(legs))
    theta = off(whole)
    outputs = tuple(map(Dof.parse, ["acc1:+tx", "acc2:-ty", "acc21:+tz"]))
    frf_request = FrfRequest(np.array([30.0, 88.0, 140.0]), outputs, (Dof("acc11", "+tx"),))
    lines = linearise(whole, theta, frf_request)
    sizes = np.array([size_of(parameter) for parameter in whole.parameters])
    columns = (lines.columns() * sizes)[..., -12:]
    expected = differences(whole, theta, frf_request)[..., -12:]
    assert worst_column(columns, expected, lines.values) < 1e-6
    assert_gradient_is_contraction(lines)
    assert [p.name for p in model.parameters][-2:] == ["leg6.stiffness", "leg6.damping"]


def test_a_leg_of_twice_the_stiffness_changes_its_own_direction_only(legs):
    model = as_drawn(legs)
    theta = model.drawn.copy()
    index = [p.name for p in model.parameters].index("leg3.stiffness")
    theta[index] *= 2
    added = model.matrices(theta).stiffness - model.matrices(model.drawn).stiffness
    (leg,) = (s for s in legs.springs if s.name == "leg3")
    np.testing.assert_allclose(
        added,
        leg.stiffness * np.outer(leg.direction, leg.direction),
        atol=1e-9 * np.abs(added).max() + 1e-16 * np.abs(model.matrices(theta).stiffness).max(),
    )


def test_the_station_on_legs_moves_like_the_station_below_the_hexapods_own_modes(station, legs):
    outputs = tuple(Dof.of(name, axis) for name in ("acc7", "acc12", "acc20") for axis in range(3))
    frf_request = FrfRequest(
        np.linspace(5, 30, 11), outputs, (Dof("acc11", "+tx"), Dof("acc11", "+tz"))
    )
    with_joints, with_legs = (as_drawn(machine) for machine in (station, legs))
    expected = linearise(with_joints, with_joints.drawn, frf_request).values
    values = linearise(with_legs, with_legs.drawn, frf_request).values
    assert worst_of_channels(values, expected) < 0.05
