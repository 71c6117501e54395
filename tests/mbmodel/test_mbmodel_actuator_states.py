"""Actuators with a state: MuJoCo's transition matrices, closed forms, exact slopes and loops."""

import control
import mujoco
import numpy as np
import pytest
from typer.testing import CliRunner

from identification.readers.controller import controller_from_roots
from identification.words import Loop, PortSum, UsageError
from mbmodel import (
    Evaluator,
    FrfRequest,
    Model,
    as_drawn,
    body_parts,
    joint_parts,
    load_machine,
    model_modes,
    parse_input,
    parse_output,
    respond_linearly,
    simulate,
    spring_parts,
    state_space,
    with_loops,
)
from mbmodel.linearisation.equilibrium import find_equilibrium
from mbmodel.mjcf.keyframes import pose_data
from mbmodel.simulation.drives import parse_reading
from mbw.command import app

ARM = """<mujoco model="arm"><option timestep="1e-4" integrator="Euler">
<flag eulerdamp="disable" contact="disable"/></option><worldbody>
<body name="a"><joint name="a_x" type="slide" axis="1 0 0" stiffness="3e4" damping="7"/>
<joint name="a_r" type="hinge" axis="0 1 0" stiffness="900" damping="6"/>
<geom type="box" size=".1 .1 .1" mass="4" pos="0 0 .1"/><site name="acc1" pos="0 0 .2"/>
<body name="b" pos=".1 0 .3"><joint name="b_x" type="slide" axis="1 0 0" damping="2"/>
<geom type="box" size=".1 .05 .1" mass="2"/><site name="acc2" pos="0.05 0 .1"/></body></body>
</worldbody><actuator>
<general name="filter" joint="a_x" dyntype="filter" dynprm="0.02" gainprm="120"
 biastype="affine" biasprm="3 -100 -2"/>
<position name="servo" joint="b_x" kp="5e3" kv="20" timeconst="0.01"/>
<intvelocity name="rate" joint="a_r" kp="40" actrange="-1 1"/>
<general name="pull" site="acc2" gear="1 0 0.3 0 0 0" dyntype="filter" dynprm="0.05" gainprm="7"/>
<velocity name="damper" joint="b_x" kv="3"/></actuator>
<sensor><actuatorfrc name="force" actuator="servo"/><jointpos name="encoder" joint="b_x"/></sensor>
<keyframe><key name="home" ctrl="0.1 0.02 0 2 0" act="0.1 0.02 0.05 2"/></keyframe></mujoco>"""
STATES = ["filter", "servo", "rate", "pull"]
DRIVES = [*STATES, "damper"]
OUTPUTS = ["joint:a_x", "force", "acc2:+tx", "encoder"]
FREQ = np.linspace(0.5, 60, 80)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("arm") / "arm.xml"
    path.write_text(ARM)
    return path


@pytest.fixture(scope="module")
def machine(path):
    return load_machine(path)


def request(machine, outputs, inputs, freq=FREQ, quantity="receptance"):
    return FrfRequest(
        freq,
        tuple(parse_output(machine, text) for text in outputs),
        tuple(parse_input(machine, text) for text in inputs),
        quantity,
    )


def test_states_are_those_of_mujocos_transition_matrices(path, machine):
    compiled = mujoco.MjModel.from_xml_path(str(path))
    rest = find_equilibrium(compiled, path, pose_data(compiled, "home")).data
    size, step = 2 * compiled.nv + compiled.na, compiled.opt.timestep
    a, b = np.zeros((size, size)), np.zeros((size, compiled.nu))
    mujoco.mjd_transitionFD(compiled, rest, 1e-6, True, a, b, None, None)
    a, b = (a - np.eye(size)) / step, b / step
    model = as_drawn(machine)
    system = state_space(model, model.drawn, request(machine, OUTPUTS, DRIVES))
    assert system.state_labels[6:] == [f"{name}_act" for name in STATES]
    exact = np.ones(size)  # over a step the servo's filter is exact, the others are Euler's
    exact[7] = (1 - np.exp(-100 * step)) / (100 * step)
    for ours, theirs in ((exact[:, None] * system.A, a), (exact[:, None] * system.B, b)):
        worst = np.abs(ours[3:] - theirs[3:]).max(axis=1) / np.abs(ours[3:]).max(axis=1).clip(1)
        assert worst.max() < 1e-6
        # positions move by the new rates: the integrator is semi-implicit
        np.testing.assert_allclose(theirs[:3], ours[:3] + step * ours[3:6], atol=1e-6)


@pytest.mark.parametrize("quantity", ["receptance", "accelerance"])
def test_frfs_are_those_of_the_state_space(machine, quantity):
    model = as_drawn(machine)
    asked = request(machine, OUTPUTS, DRIVES, quantity=quantity)
    values = Evaluator(model, asked).at(model.drawn).values
    system = state_space(model, model.drawn, asked)
    expected = system(2j * np.pi * FREQ).transpose(2, 0, 1)
    np.testing.assert_allclose(values, expected, atol=1e-10 * np.abs(expected).max())
    sampled = control.c2d(system, 1e-3)
    assert sampled.nstates == 10


def test_frfs_have_exact_slopes(tmp_path):
    (tmp_path / "arm.xml").write_text(ARM.replace("<option", '<option gravity="0 0 0"'))
    machine = load_machine(tmp_path / "arm.xml", key="")  # the equilibrium stays
    model = Model(machine, (*spring_parts(machine), *body_parts(machine), *joint_parts(machine)))
    evaluator = Evaluator(model, request(machine, ["acc2:+tx", "acc1:+tz"], DRIVES))
    lines = evaluator.at(model.drawn)
    columns, weights = lines.columns(), np.exp(1j * np.arange(80 * 10)).reshape(80, 2, 5)
    expected = np.einsum("foi,foip->p", weights.conj(), columns).real
    np.testing.assert_allclose(
        lines.gradient(weights), expected, rtol=1e-8, atol=1e-11 * np.abs(expected).max()
    )
    for k in range(len(model.drawn)):
        size = 1e-6 * max(abs(model.drawn[k]), 0.1)
        step = size * np.eye(len(model.drawn))[k]
        slope = (
            evaluator.at(model.drawn + step).values - evaluator.at(model.drawn - step).values
        ) / (2 * size)
        scale = max(np.abs(columns[..., k]).max(), np.abs(lines.values).max())
        np.testing.assert_allclose(columns[..., k], slope, atol=2e-6 * scale)


def test_a_state_stays_where_the_equilibrium_moves(path, tmp_path):
    (tmp_path / "stiffer.xml").write_text(ARM.replace('stiffness="900"', 'stiffness="1080"'))
    values = []
    for file, share in ((path, 1.2), (tmp_path / "stiffer.xml", 1.0)):
        model = as_drawn(load_machine(file, follow=True))
        assert model.machine.statics is not None
        theta = model.drawn.copy()
        theta[[each.name for each in model.parameters].index("a_r.stiffness")] *= share
        values.append(Evaluator(model, request(model.machine, OUTPUTS, DRIVES)).at(theta).values)
    np.testing.assert_allclose(*values, atol=1e-6 * np.abs(values[1]).max())


@pytest.mark.parametrize("delay", [0.0, 2e-3])
def test_a_loop_closes_through_the_state(machine, delay):
    controller = controller_from_roots([-30.0], [-200.0], 2.0)
    encoder = PortSum("servo", ((parse_output(machine, "encoder"), 1.0),), "m", 0)
    loop = Loop("servo", parse_input(machine, "servo"), encoder, controller, "N", delay)
    closed = as_drawn(with_loops(machine, (loop,)))
    opened = as_drawn(machine)
    asked = request(machine, ["encoder"], ["servo", "filter"])
    plant = Evaluator(opened, asked).at(opened.drawn).values[:, 0]
    s = 2j * np.pi * FREQ
    gain = controller.response(s) * np.exp(-s * delay)
    expected = plant / (1 + gain * plant[:, 0])[:, None]
    values = Evaluator(closed, asked).at(closed.drawn).values[:, 0]
    np.testing.assert_allclose(values, expected, atol=1e-9 * np.abs(expected).max())
    system = state_space(closed, closed.drawn, asked)
    np.testing.assert_allclose(
        system(s)[0].T, expected, atol=(1e-5 if delay else 1e-9) * np.abs(expected).max()
    )
    if not delay:
        plant = state_space(opened, opened.drawn, request(machine, ["encoder"], ["servo"]))
        k = control.ss(
            controller.dynamics,
            controller.input_matrix,
            controller.output_matrix,
            controller.feedthrough,
        )
        poles = control.feedback(plant, k).poles()
        for pole in model_modes(closed, closed.drawn).poles:
            assert np.abs(poles - pole).min() < 1e-6 * abs(pole)


def test_the_linear_response_is_mujocos_in_time(machine):
    time_s = np.arange(400) * 2e-3
    pulse = 1e-5 * np.sin(np.pi * np.clip(time_s / 0.1, 0, 1)) ** 2
    asked = request(machine, ["encoder", "joint:a_r"], ["servo", "rate"])
    signals = np.column_stack([pulse, 10 * pulse])
    model = as_drawn(machine)
    linear = respond_linearly(model, model.drawn, asked, time_s, signals)
    readings = [parse_reading(machine, str(port)) for port in asked.outputs]
    response = simulate(machine, asked.inputs, readings, time_s, signals)
    assert response.step.error < 5e-3
    worst = np.abs(response.outputs - linear).max(axis=0) / np.abs(linear).max(axis=0)
    assert (worst < 1.2 * response.step.error).all()


def test_an_integrator_has_no_response_at_0_hz(machine):
    model = as_drawn(machine)
    asked = request(machine, ["encoder"], ["rate"], np.array([0.0, 1.0]))
    with pytest.raises(UsageError, match="no finite response at 0 Hz"):
        Evaluator(model, asked).at(model.drawn)


def test_predict_takes_the_actuator_as_input(path):
    words = ["--input", "servo", "--output", "encoder", "--frf", "--lines", "3", "--quiet"]
    done = CliRunner().invoke(app, ["predict", str(path), *words])
    assert done.exit_code == 0, done.output
    row = [float(word) for word in done.stdout.splitlines()[2].split(",")]
    machine = load_machine(path)
    model = as_drawn(machine)
    asked = request(machine, ["encoder"], ["servo"], np.array([row[0]]))
    expected = Evaluator(model, asked).at(model.drawn).values.item()
    assert complex(row[1], row[2]) == pytest.approx(expected, rel=1e-9)
