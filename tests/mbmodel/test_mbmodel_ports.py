"""Motors, encoders, MuJoCo sensors, pairs and points as ports, against MuJoCo and by hand."""

from dataclasses import replace
from pathlib import Path

import control
import mujoco
import numpy as np
import pytest

from identification.words import Dof, Signal, UsageError, parse_port
from mbmodel import (
    Evaluator,
    FrfRequest,
    Machine,
    as_drawn,
    find_ports,
    input_unit,
    load_machine,
    output_unit,
    parse_input,
    parse_output,
    state_space,
    usual_quantity,
)
from tests.helpers.port_machine import state_space_by_differences, write_port_machine

FREQ = np.array([0.5, 3.0, 11.0, 24.0, 90.0])


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_port_machine(tmp_path_factory.mktemp("ports"))


@pytest.fixture(scope="module")
def machine(path: Path) -> Machine:
    return load_machine(path)


def _values(machine: Machine, outputs: list[str], inputs: list[str], quantity: str) -> np.ndarray:
    request = FrfRequest(
        FREQ,
        tuple(parse_output(machine, text) for text in outputs),
        tuple(parse_input(machine, text) for text in inputs),
        quantity,
    )
    return Evaluator(as_drawn(machine), request).at(as_drawn(machine).drawn).values


def test_every_sensor_answers_every_motor_and_force_as_mujoco_differences_say(
    machine: Machine, path: Path
) -> None:
    model = mujoco.MjModel.from_xml_path(str(path))
    push = np.zeros((model.nbody, 6))
    push[2, :3] = 0.0, 0.0, 1.0
    a, b, c, d = state_space_by_differences(path, {"carriage:+tz": push})
    laplace = 2j * np.pi * FREQ[:, None, None]
    expected = c @ np.linalg.solve(laplace * np.eye(len(a)) - a, b) + d
    inputs = ["drive", "voice_coil", "jet", "servo", "pull", "carriage:+tz"]
    names = [name for name in machine.sensors.readings if name not in ("touch", "clipped")]
    values = _values(machine, names, inputs, "accelerance")
    for name, answer in zip(names, values.transpose(1, 0, 2), strict=True):
        base, _, number = name.partition(".")
        first, dim = int(model.sensor(base).adr[0]), int(model.sensor(base).dim[0])
        scale = np.abs(expected[:, first : first + dim]).max()
        # Differences of mj_forward at a step of 1e-6 hold 7 digits of the stiffness; a force is
        # the small difference of inertia and springs, and loses two of them.
        tolerance = 1e-4 if base in ("force", "torque") else 3e-6
        error = np.abs(answer - expected[:, first + int(number or 0)]).max()
        assert error <= tolerance * scale, name


@pytest.mark.parametrize("quantity", ["receptance", "accelerance"])
def test_the_state_space_gives_the_frfs_of_all_sensors(machine: Machine, quantity: str) -> None:
    names = [*machine.sensors.readings, "joint:frame_tx", "coil-magnet:+tx", "acc2:+ty"]
    inputs = ["drive", "servo", "carriage@0,0.1,0:+tz", "joint:frame_ry"]
    request = FrfRequest(
        FREQ,
        tuple(parse_output(machine, text) for text in names),
        tuple(parse_input(machine, text) for text in inputs),
        quantity,
    )
    model = as_drawn(machine)
    expected = Evaluator(model, request).at(model.drawn).values
    system = state_space(model, model.drawn, request)
    response = control.frequency_response(system, 2 * np.pi * FREQ, squeeze=False)
    values = np.moveaxis(np.asarray(response.complex), -1, 0)
    scale = np.abs(expected).max(axis=0) + 1e-300
    assert (np.abs(values - expected).max(axis=0) <= 1e-7 * scale.max(axis=1, keepdims=True)).all()


def test_motor_to_encoder_equals_a_hand_made_two_mass_axis(tmp_path: Path) -> None:
    # M q'' + C q' + K q = B u, y = q_2 - q_1: two carriages on one rail, a motor with gear 7
    # between them, a linear encoder on the second joint.
    m1, m2, k1, k2, c1, c2, gear = 12.0, 5.0, 3e5, 8e4, 40.0, 15.0, 7.0
    path = tmp_path / "axis.xml"
    path.write_text(
        f"""<mujoco><option gravity="0 0 0"/><worldbody><body name="base">
        <joint name="base_tx" type="slide" axis="1 0 0" stiffness="{k1}" damping="{c1}"/>
        <inertial pos="0 0 0" mass="{m1}" diaginertia="1 1 1"/><site name="rail"/>
        <body name="slide"><joint name="slide_tx" type="slide" axis="1 0 0" stiffness="{k2}"
        damping="{c2}"/><inertial pos="0 0 0" mass="{m2}" diaginertia="1 1 1"/><site name="head"/>
        </body></body></worldbody>
        <actuator><motor name="drive" joint="slide_tx" gear="{gear}"/></actuator>
        <sensor><jointpos name="encoder" joint="slide_tx"/></sensor></mujoco>""",
        encoding="utf-8",
    )
    machine = load_machine(path)
    mass = np.array([[m1 + m2, m2], [m2, m2]])  # in relative coordinates
    s = 2j * np.pi * FREQ[:, None, None]
    stiffness, damping = np.diag([k1, k2]), np.diag([c1, c2])
    expected = np.linalg.solve(s**2 * mass + s * damping + stiffness, np.array([0.0, gear]))[..., 1]
    for output in ("encoder", "joint:slide_tx", "head-rail:+tx"):
        values = _values(machine, [output], ["drive"], "receptance")[:, 0, 0]
        assert np.abs(values / expected - 1).max() < 1e-9, output
    # A motor between two bodies is a pair of forces, and so is a force along the joint.
    pair = _values(machine, ["encoder"], ["head-rail:+tx", "joint:slide_tx"], "receptance")[:, 0]
    assert np.abs(gear * pair / expected[:, None] - 1).max() < 1e-9


def test_ports_of_a_machine_are_read_once(machine: Machine) -> None:
    ports = [parse_output(machine, text) for text in ("joint:carriage_ry", "acc2:+ry")]
    first = find_ports(machine, ports, ports[1:])
    assert find_ports(machine, tuple(ports), tuple(ports[1:])) is first
    assert find_ports(machine, ports, ports) is not first
    assert find_ports(replace(machine), ports, ports[1:]) is not first


def test_pairs_joints_and_offsets_are_reciprocal(machine: Machine) -> None:
    ports = ["coil-magnet:+tz", "joint:carriage_ry", "carriage@0.1,0,0.2:-ty", "acc2:+ry"]
    values = _values(machine, ports, ports, "receptance")
    assert np.abs(values - values.transpose(0, 2, 1)).max() < 1e-12 * np.abs(values).max()


def test_a_pair_pushes_one_site_and_pulls_the_other(machine: Machine) -> None:
    # The axes are those of the first site; magnet and coil are drawn with equal axes, and the
    # sag under gravity turns one against the other by 1e-7 rad.
    values = _values(
        machine, ["acc1:+tz"], ["coil-magnet:+tx", "coil:+tx", "magnet:+tx"], "mobility"
    )[:, 0]
    error = np.abs(values[:, 0] - values[:, 1] + values[:, 2]).max()
    assert error < 1e-6 * np.abs(values).max()


def test_a_sensor_reads_its_own_quantity_whatever_is_requested(machine: Machine) -> None:
    outputs = ["encoder", "tacho", "joint:carriage_tx"]
    receptance = _values(machine, outputs, ["drive"], "receptance")
    accelerance = _values(machine, outputs, ["drive"], "accelerance")
    assert np.allclose(receptance[:, :2], accelerance[:, :2], rtol=1e-10)
    s = 2j * np.pi * FREQ
    assert np.allclose(accelerance[:, 2, 0], s**2 * receptance[:, 2, 0], rtol=1e-10)


@pytest.mark.parametrize(
    ("labels", "quantity"),
    [
        (("joint:slide_a",), "receptance"),
        (("joint:slide_a", "encoder"), "receptance"),
        (("joint:slide_a", "acc1:+tx"), "accelerance"),
        (("acc1-acc2:+tx",), "accelerance"),
        ((), "accelerance"),
    ],
)
def test_positions_of_encoders_are_meant_where_no_quantity_is_stated(labels, quantity) -> None:
    assert usual_quantity([parse_port(label) for label in labels]) == quantity


@pytest.mark.parametrize(
    ("port", "unit"),
    [
        ("encoder", "m"),
        ("tacho", "rad/s"),
        ("imu.2", "m/s²"),
        ("force", "N"),
        ("joint:carriage_ry", "rad/s²"),
        ("coil-magnet:+rx", "rad/s²"),
        ("carriage@0,0,0.1:+tz", "m/s²"),
    ],
)
def test_units_of_outputs(machine: Machine, port: str, unit: str) -> None:
    assert output_unit(machine, parse_output(machine, port), "accelerance") == unit


@pytest.mark.parametrize(
    ("port", "unit"),
    [
        ("drive", "control"),
        ("joint:carriage_ry", "N m"),
        ("coil-magnet:+tx", "N"),
        ("floor:+ty", "m/s²"),
    ],
)
def test_units_of_inputs(machine: Machine, port: str, unit: str) -> None:
    assert input_unit(machine, parse_input(machine, port)) == unit


@pytest.mark.parametrize(
    ("port", "reason"),
    [
        ("touch", "kind touch has no linear model"),
        ("clipped", "at its cutoff"),
        ("drive", "is a motor of the model, and no sensor"),
        ("nothing", "no sensor of the model"),
        ("joint:nowhere", "no slide or hinge of this name"),
        ("coil-nowhere:+tx", "neither a point, a pair"),
        ("carriage@1,2:+tx", "no offset: write three numbers"),
    ],
)
def test_what_has_no_linear_model_is_refused_by_name(
    machine: Machine, port: str, reason: str
) -> None:
    with pytest.raises(UsageError, match=reason) as refusal:
        parse_output(machine, port)
    assert port.partition(":")[0] in str(refusal.value)


def test_a_model_without_motors_is_told_to_name_a_point(tmp_path: Path, machine: Machine) -> None:
    with pytest.raises(UsageError, match="choose one of drive"):
        _values(machine, ["carriage:+tz"], ["engine"], "receptance")
    without = tmp_path / "without.xml"
    without.write_text(
        '<mujoco><option gravity="0 0 0"/><worldbody><body name="mass"><inertial pos="0 0 0" '
        'mass="1" diaginertia="1 1 1"/><joint type="slide" stiffness="9"/></body></worldbody>'
        "</mujoco>",
        encoding="utf-8",
    )
    with pytest.raises(UsageError, match=r"has none: name a point and its direction"):
        _values(load_machine(without), ["mass:+tz"], ["engine"], "receptance")


def test_names_with_the_mark_of_a_pair_are_points_if_there_is_such_a_point() -> None:
    assert parse_port("a-b:+x", ("a-b",)) == Dof("a-b", "+tx")
    assert parse_port("a-b:-x", ("a", "b")) == Signal("a-b:-tx")
    assert Signal("a-b:-x").positive == Signal("a-b:+tx")
    assert Signal("a-b:-x").sign == -1


def test_frequencies_that_are_no_numbers_are_refused():
    with pytest.raises(UsageError, match="line 1 is nan"):
        FrfRequest(np.array([1.0, np.nan]), (), ())
