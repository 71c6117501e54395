"""Motors and a moving floor as inputs, a spinning rotor: closed forms, and slopes with a floor."""

import numpy as np
import pytest
from mbmodel_examples import mass_on_spring, mjcf, random_tree, some_dofs, worst_of_channels
from test_mbmodel_parts import differences, off, size_of
from test_mbmodel_slopes import assert_gradient_is_contraction, worst_column

from identification.words import Dof, Signal, UsageError
from mbmodel import (
    FrfRequest,
    Model,
    as_drawn,
    body_parts,
    joint_parts,
    linearise,
    load_machine,
    modes_of_matrices,
    parse_input,
    sensor_parts,
    spring_parts,
    state_space,
)

FREQ = np.array([3.0, 11.0, 17.0, 30.5, 60.0, 117.0])
S = 2j * np.pi * FREQ
TZ = (Dof("acc1", "+tz"),)


def test_a_floor_shakes_one_mass_by_its_transmissibility(from_text):
    # y'' / u'' = (c s + k) / (m s^2 + c s + k).
    model = as_drawn(from_text(mjcf(mass_on_spring(4.0, 3e4, 11.0))))
    frf_request = FrfRequest(FREQ, TZ, (Dof("floor", "+tz"),))
    expected = (11 * S + 3e4) / (4 * S**2 + 11 * S + 3e4)
    values = linearise(model, model.drawn, frf_request).values[:, 0, 0]
    np.testing.assert_allclose(values, expected, rtol=1e-12)


def test_a_floors_quantities_differ_by_powers_of_s(from_text):
    model = as_drawn(from_text(mjcf(mass_on_spring(4.0, 3e4, 11.0))))
    floor = (Dof("floor", "-tz"),)
    values = [
        linearise(model, model.drawn, FrfRequest(FREQ, TZ, floor, quantity)).values[:, 0, 0]
        for quantity in ("receptance", "mobility", "accelerance")
    ]
    np.testing.assert_allclose(values[0] * S, values[1], rtol=1e-12)
    np.testing.assert_allclose(values[1] * S, values[2], rtol=1e-12)


@pytest.mark.parametrize("direction", ["tx", "ty", "tz", "rx", "ry", "rz"])
def test_below_all_modes_the_station_moves_with_its_floor(station_model, direction):
    dof = Dof("floor", f"+{direction}")
    outputs = tuple(Dof.of(body, axis) for body in ("tilt", "hexapod") for axis in range(6))
    frf_request = FrfRequest(np.array([0.0, 1e-4]), outputs, (dof,))
    values = linearise(station_model, station_model.drawn, frf_request).values[:, :, 0]
    rows = station_model.machine.layout.rows(outputs)
    expected = rows @ station_model.machine.floor_jacobian[:, dof.axis]
    np.testing.assert_allclose(values[0], expected, atol=1e-12)
    np.testing.assert_allclose(values[1], expected, atol=1e-7)


def test_a_floor_is_a_heavy_body_that_is_hit(from_text):
    # The same tree on a floating block 1e9 times heavier: what it does per motion of the block.
    tree = random_tree(4, n_body=3)
    body = tree[tree.index("<worldbody>") + 11 : tree.index("</worldbody>")]
    slides = "".join(
        f'<joint name="block_{axis}" type="slide" axis="{axis}"/>'
        for axis in ("1 0 0", "0 1 0", "0 0 1")
    )
    block = (
        f'<body name="block"><inertial pos="0 0 0" mass="1e12" diaginertia="1 1 1"/>{slides}{body}'
        "</body>"
    )
    small, big = as_drawn(from_text(tree)), as_drawn(from_text(mjcf(block)))
    outputs = some_dofs(small.machine, 5, 3)
    freq = np.array([20.0, 55.0, 90.0, 240.0])
    for axis in range(3):
        floor = FrfRequest(freq, outputs, (Dof.of("floor", axis),))
        hit = FrfRequest(freq, outputs, (Dof.of("block", axis),))
        moved = FrfRequest(freq, (Dof.of("block", axis),), (Dof.of("block", axis),))
        expected = linearise(big, big.drawn, hit).values / linearise(big, big.drawn, moved).values
        values = linearise(small, small.drawn, floor).values
        assert worst_of_channels(values, expected) < 1e-7


@pytest.mark.parametrize("quantity", ["accelerance", "receptance"])
def test_slopes_are_right_where_the_floor_moves(from_text, quantity):
    machine = from_text(random_tree(4, n_body=3))
    parts = (*spring_parts(machine)[:1], *body_parts(machine), *joint_parts(machine))
    model = Model(machine, (*parts, *sensor_parts(machine)[:2]))
    outputs = some_dofs(machine, 4, 8)
    inputs = (Dof("floor", "-ty"), some_dofs(machine, 1, 9)[0], Dof("floor", "+rx"))
    frf_request = FrfRequest(FREQ + 2.0, outputs, inputs, quantity)
    theta = off(model, amount=0.4)
    lines = linearise(model, theta, frf_request)
    sizes = np.array([size_of(parameter) for parameter in model.parameters])
    assert worst_column(
        lines.columns() * sizes, differences(model, theta, frf_request), lines.values
    ) < (1e-6)
    assert_gradient_is_contraction(lines)


@pytest.mark.parametrize("quantity", ["accelerance", "mobility", "receptance"])
def test_python_control_gives_the_same_with_floor_and_motor(from_text, quantity):
    model = as_drawn(from_text(driven()))
    inputs = (Dof("floor", "+tx"), Signal("push"), Dof("acc2", "-tz"), Dof("floor", "-tz"))
    outputs = tuple(map(Dof.parse, ["acc2:+tz", "acc1:-tz", "b:+tx", "b:+tz", "a:+tz"]))
    frf_request = FrfRequest(FREQ, outputs, inputs, quantity)
    system = state_space(model, model.drawn, frf_request)
    expected = system(S).transpose(2, 0, 1)
    values = linearise(model, model.drawn, frf_request).values
    assert worst_of_channels(values, expected) < 1e-10
    assert system.input_labels[:2] == ["floor:+tx", "push"]


def driven(motor='<motor name="push" joint="b_j" gear="2.5"/>'):
    """Two masses in a row, a motor between them."""
    inner = mass_on_spring(2.0, 2e4, 7.0, name="b", node=2, pos="0 0 0.3")
    outer = mass_on_spring(5.0, 4e4, 9.0).replace("</body>", inner + "</body>")
    return mjcf(outer).replace("</mujoco>", f"<actuator>{motor}</actuator></mujoco>")


def test_a_motor_pushes_its_joint_by_its_gear(from_text):
    model = as_drawn(from_text(driven()))
    outputs = tuple(map(Dof.parse, ["a:+tz", "b:+tz"]))
    frf_request = FrfRequest(FREQ, outputs, (Signal("push"), *outputs), "receptance")
    values = linearise(model, model.drawn, frf_request).values
    between = 2.5 * (values[:, :, 2] - values[:, :, 1])
    assert worst_of_channels(values[:, :, :1], between[:, :, None]) < 1e-12


def test_a_servos_control_moves_its_set_point(from_text):
    # Static: its own spring kp in series balances the joint's k: x = kp / (k + kp) per control.
    servo = '<position name="hold" joint="b_j" kp="3e4" ctrlrange="-1e-3 1e-3"/>'
    model = as_drawn(from_text(driven(servo)))
    frf_request = FrfRequest(
        np.array([0.0]), tuple(map(Dof.parse, ["b:+tz"])), (Signal("hold"),), "receptance"
    )
    value = linearise(model, model.drawn, frf_request).values[0, 0, 0]
    assert value == pytest.approx(3e4 / (2e4 + 3e4), rel=1e-9)


def test_labels_and_motors_are_distinguished(from_text):
    machine = from_text(driven())
    assert parse_input(machine, "push") == Signal("push")
    assert parse_input(machine, "acc1:z") == Dof("acc1", "+tz")
    with pytest.raises(UsageError, match="no motor of the model: choose one of push"):
        linearise(
            as_drawn(machine), as_drawn(machine).drawn, FrfRequest(FREQ, TZ, (Signal("pull"),))
        )


def test_a_tilting_floor_under_gravity_is_refused(from_text):
    text = mjcf(mass_on_spring(4.0, 3e4, 11.0), gravity="0 0 -9.81")
    model = as_drawn(from_text(text))
    with pytest.raises(UsageError, match="a tilting floor"):
        linearise(model, model.drawn, FrfRequest(FREQ, TZ, (Dof("floor", "+rx"),)))
    linearise(model, model.drawn, FrfRequest(FREQ, TZ, (Dof("floor", "+tx"),)))


def test_a_floors_displacement_at_0_hz_is_refused(station_model):
    frf_request = FrfRequest(
        np.array([0.0, 1.0]), (Dof("acc1", "+tx"),), (Dof("floor", "+tx"),), "receptance"
    )
    with pytest.raises(UsageError, match="no value at 0 Hz"):
        linearise(station_model, station_model.drawn, frf_request)


def rotor(*, polar=0.4, across=0.3, extra="", offset="0 0 0"):
    """A rotor on two tilting springs, with a free drive about z."""
    return mjcf(
        '<body name="rotor">'
        f'<inertial pos="{offset}" mass="5" diaginertia="{across} {across} {polar}"/>'
        '<joint name="x" type="hinge" axis="1 0 0" stiffness="2000" damping="0.3"/>'
        '<joint name="y" type="hinge" axis="0 1 0" stiffness="2000" damping="0.3"/>'
        '<joint name="drive" type="hinge" axis="0 0 1" damping="0.01"/>'
        f'<site name="acc1" pos="0.2 0 0"/>{extra}</body>'
    )


def load_spinning(tmp_path, text, **spin):
    path = tmp_path / "rotor.xml"
    path.write_text(text)
    return load_machine(path, spin)


def test_a_spinning_rotor_splits_its_tilting_mode_into_forward_and_backward(tmp_path):
    # A q'' -+ i H q' + k q = 0 for q = x + i y: w = sqrt(k/A + (H/2A)^2) -+ H/2A, H = polar rate.
    machine = load_spinning(tmp_path, rotor(), drive=150.0)
    model = as_drawn(machine)
    poles = modes_of_matrices(model.matrices(model.drawn)).poles
    half = 0.4 * 150 / (2 * 0.3)
    expected = np.sqrt(2000 / 0.3 + half**2) + half * np.array([-1, 1])
    omega = np.sort(poles.imag[poles.imag > 1.0])
    np.testing.assert_allclose(omega, expected, rtol=1e-4)  # the damping shifts it by zeta^2
    assert machine.remarks == ()


def test_a_rotors_gyroscopic_matrix_is_skew(tmp_path):
    still, turning = (load_spinning(tmp_path, rotor(), drive=rate) for rate in (0.0, 150.0))
    added = turning.remaining_damping - still.remaining_damping
    np.testing.assert_allclose(added, -added.T, atol=1e-7)
    assert np.abs(added).max() == pytest.approx(0.4 * 150, rel=1e-8)
    np.testing.assert_allclose(turning.remaining_stiffness, 0, atol=1e-5)


def test_a_rotor_that_carries_a_joint_is_said_to_be_periodic(tmp_path):
    carried = mass_on_spring(1.0, 1e5, 3.0, name="tool", node=2, axis="1 0 0", pos="0 0 0.1")
    (remark,) = load_spinning(tmp_path, rotor(extra=carried), drive=150.0).remarks
    assert "body 'tool'" in remark
    assert "periodic in time" in remark


@pytest.mark.parametrize(
    "text",
    [rotor(offset="0.02 0 0"), rotor().replace("0.3 0.3 0.4", "0.3 0.35 0.4")],
    ids=["eccentric", "oval"],
)
def test_a_rotor_that_is_not_round_is_said_to_be_periodic(tmp_path, text):
    (remark,) = load_spinning(tmp_path, text, drive=150.0).remarks
    assert "not axisymmetric" in remark


def test_only_a_hinge_of_the_machine_can_spin(tmp_path):
    with pytest.raises(
        UsageError, match="'wheel' is no hinge that could spin: choose one of x, y, drive"
    ):
        load_spinning(tmp_path, rotor(), wheel=1.0)
    with pytest.raises(UsageError, match="rate in rad/s"):
        load_spinning(tmp_path, rotor(), drive=float("nan"))
