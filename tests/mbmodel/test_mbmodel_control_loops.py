"""Closed control loops: closed forms, python-control, exact slopes, modes and state spaces."""

import control
import numpy as np
import pytest
from encoder_campaign import CHANNELS, REFERENCES, axis_frfs, write_axis

from identification.readers.controller import controller_from_roots
from identification.words import Controller, Loop, PortSum, UsageError
from mbmodel import (
    Evaluator,
    FrfRequest,
    ModeEvaluator,
    Model,
    as_drawn,
    body_parts,
    joint_parts,
    load_machine,
    model_modes,
    parse_input,
    parse_output,
    spring_parts,
    state_space,
    with_loops,
)

FREQ = np.linspace(3.0, 170.0, 120)
S = 2j * np.pi * FREQ
MASS_ON_SPRING = """<mujoco><option gravity="0 0 0"/><worldbody><body name="block">
<joint name="block_tx" type="slide" axis="1 0 0" stiffness="{k}" damping="{c}"/>
<inertial pos="0 0 0" mass="{m}" diaginertia="1 1 1"/><site name="acc1"/></body></worldbody>
<actuator><motor name="drive" joint="block_tx"/></actuator></mujoco>"""
# PD with a roll-off: proportional gain, derivative gain, corner of the roll-off.
KP, KD, CORNER = 4e4, 60.0, 2 * np.pi * 300


def pd(kp=KP, kd=KD, corner=CORNER):
    """(kp + kd s) / (1 + s / corner)."""
    return controller_from_roots([-kp / kd], [-corner], kd * corner)


def pd_law(s, delay=0.0):
    return (KP + KD * s) / (1 + s / CORNER) * np.exp(-s * delay)


def loop_on(machine, name, drive, outputs, controller, delay=0.0, derivative=0):
    terms = tuple((parse_output(machine, text), weight) for text, weight in outputs)
    measured = PortSum(name, terms, "m", derivative)
    return Loop(name, parse_input(machine, drive), measured, controller, "N", delay)


@pytest.fixture(scope="module")
def axis(tmp_path_factory):
    path = tmp_path_factory.mktemp("axis") / "model.xml"
    write_axis(path)
    return load_machine(path)


@pytest.fixture(scope="module")
def loops(axis):
    """A motor that an encoder closes, with a delay, and a coil that reads two velocities."""
    return (
        loop_on(axis, "servo", "drive", [("encoder", 1.0)], pd(5e3, 8.0), 3e-4),
        loop_on(
            axis,
            "damper",
            "coil-magnet:+tx",
            [("head:+tx", 1.0), ("acc1:+tx", -1.0)],
            controller_from_roots([], [-2 * np.pi * 400], 300 * 2 * np.pi * 400),
            1e-4,
            derivative=1,
        ),
    )


def frfs(machine, outputs, inputs, freq=FREQ, quantity="receptance", **options):
    request = FrfRequest(
        freq,
        tuple(parse_output(machine, text) for text in outputs),
        tuple(parse_input(machine, text) for text in inputs),
        quantity,
    )
    model = as_drawn(machine)
    return Evaluator(model, request, **options).at(model.drawn).values


@pytest.mark.parametrize("delay", [0.0, 8e-4])
@pytest.mark.parametrize(("output", "derivative"), [("joint:block_tx", 0), ("acc1:+tx", 2)])
def test_a_mass_on_a_spring_with_a_loop_is_its_closed_form(from_text, delay, output, derivative):
    m, c, k = 8.0, 30.0, 2e5
    machine = from_text(MASS_ON_SPRING.format(m=m, c=c, k=k))
    controller = pd() if derivative == 0 else controller_from_roots([], [-CORNER], 0.4 * CORNER)
    loop = loop_on(machine, "servo", "drive", [(output, 1.0)], controller, delay, derivative)
    values = frfs(with_loops(machine, [loop]), ["block:+tx"], ["block:+tx"])[:, 0, 0]
    law = (
        pd_law(S, delay) if derivative == 0 else 0.4 / (1 + S / CORNER) * np.exp(-S * delay) * S**2
    )
    expected = 1 / (m * S**2 + c * S + k + law)
    assert np.abs(values / expected - 1).max() < 1e-9


def test_loops_of_the_axis_are_the_algebra_of_matrices_by_hand(axis, loops):
    whole = axis_frfs(FREQ, {})  # accelerances, but for the encoder's position
    channels, references = list(CHANNELS), list(REFERENCES)
    to_inputs = [references.index("drive"), references.index("coil-magnet:+tx")]
    read = np.stack(
        [
            whole[:, channels.index("encoder")],
            whole[:, channels.index("head-acc1:+x")] / S[:, None],  # a velocity
        ],
        axis=1,
    )
    law = np.zeros((len(FREQ), 2, 2), complex)
    for number, loop in enumerate(loops):
        law[:, number, number] = loop.controller.response(S) * np.exp(-S * loop.delay)
    effort = law @ np.linalg.inv(np.eye(2) + read[:, :, to_inputs] @ law)
    expected = whole - whole[:, :, to_inputs] @ effort @ read
    values = frfs(with_loops(axis, loops), CHANNELS, REFERENCES, quantity="accelerance")
    assert np.abs(values - expected).max(axis=0) == pytest.approx(
        0, abs=1e-9 * np.abs(expected).max()
    )
    assert np.abs(values / expected - 1).max() < 1e-8
    assert np.abs(whole / expected - 1).max() > 0.5, "the loops matter"


def test_a_loop_without_delay_is_the_feedback_of_python_control(axis, loops):
    loop = loop_on(axis, "servo", "drive", [("encoder", 1.0)], loops[0].controller)
    outputs, inputs = ("encoder", "acc2:+tx"), ("drive", "hit1:+tz")
    request = FrfRequest(
        FREQ,
        tuple(parse_output(axis, text) for text in outputs),
        tuple(parse_input(axis, text) for text in inputs),
        "receptance",
    )
    model = as_drawn(axis)
    plant = state_space(model, model.drawn, request)
    k = loop.controller
    wide = control.ss(
        k.dynamics,
        k.input_matrix @ [[1.0, 0.0]],
        np.array([[1.0], [0.0]]) @ k.output_matrix,
        np.array([[1.0, 0.0], [0.0, 0.0]]) * k.feedthrough,
    )
    twin = control.feedback(plant, wide)
    expected = np.moveaxis(twin(S), -1, 0)
    values = frfs(with_loops(axis, [loop]), outputs, inputs)
    assert np.abs(values / expected - 1).max() < 1e-7
    poles = model_modes(as_drawn(with_loops(axis, [loop])), model.drawn).poles
    for pole in twin.poles():
        if pole.imag >= 0:
            assert np.abs(poles - pole).min() < 1e-7 * abs(pole)
    assert len(poles) == (twin.poles().imag >= 0).sum()


def toleranced(machine):
    return Model(machine, (*spring_parts(machine), *body_parts(machine), *joint_parts(machine)))


def differences(evaluator, theta, steps):
    columns = []
    for k, step in enumerate(steps):

        def at(scale, k=k, step=step):
            moved = theta.copy()
            moved[k] += scale * step
            return evaluator(moved)

        columns.append((8 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12 * step))
    return np.stack(columns, axis=-1)


def steps_of(model, theta):
    return np.array(
        [
            2e-4 * abs(value) if parameter.positive else 1e-5
            for parameter, value in zip(model.parameters, theta, strict=True)
        ]
    )


@pytest.mark.parametrize("inputs", [("hit1:+tz", "drive"), ("floor:+tx", "floor:+tz")])
def test_slopes_of_springs_bodies_and_joints_through_loops_are_exact(axis, loops, inputs):
    model = toleranced(with_loops(axis, loops))
    theta = model.drawn.copy()
    theta += np.array([0 if p.positive else 2e-3 for p in model.parameters])
    request = FrfRequest(
        FREQ[::12],
        tuple(parse_output(axis, text) for text in ("acc2:+tx", "joint:carriage_tx", "acc1:+tz")),
        tuple(parse_input(axis, text) for text in inputs),
    )
    evaluator = Evaluator(model, request, direct=True)
    lines = Evaluator(model, request).at(theta)
    columns = lines.columns()
    expected = differences(lambda x: evaluator.at(x).values, theta, steps_of(model, theta))
    peak = np.abs(lines.values).max(axis=0)[None, :, :, None]
    size = np.maximum(steps_of(model, theta), 1e-12) / 2e-4
    error = np.abs(columns - expected) / peak * size
    assert error.max() < 1e-6 * (np.abs(expected) / peak * size).max()
    weights = np.random.default_rng(1).normal(size=(2, *lines.values.shape))
    cotangent = weights[0] + 1j * weights[1]
    gradient = np.einsum("foi,foip->p", cotangent.conj(), columns).real
    assert lines.gradient(cotangent) == pytest.approx(gradient, rel=1e-8)


def test_motions_of_the_floor_reach_a_loop_that_reads_an_absolute_position(axis):
    loop = loop_on(axis, "sky", "drive", [("carriage:+tx", 1.0)], pd(3e3, 20.0), 2e-4)
    closed = with_loops(axis, [loop])
    outputs = ["acc2:+tx", "carriage:+tx"]
    free = frfs(axis, outputs, ["floor:+tx", "drive"])
    # u = -K y, y the absolute position of the carriage, closed by hand.
    gain = loop.controller.response(S) * np.exp(-S * loop.delay)
    effort = gain / (1 + gain * free[:, 1, 1])
    expected = free[:, :, 0] - free[:, :, 1] * (effort * free[:, 1, 0])[:, None]
    values = frfs(closed, outputs, ["floor:+tx"])[:, :, 0]
    assert np.abs(values / expected - 1).max() < 1e-9
    request = FrfRequest(
        FREQ, (parse_output(axis, "acc2:+tx"),), (parse_input(axis, "floor:+tx"),), "receptance"
    )
    model = as_drawn(closed)
    with pytest.raises(UsageError, match="open the loop"):
        state_space(model, model.drawn, request)


def test_the_state_space_holds_controllers_and_delays(axis, loops):
    closed = with_loops(axis, loops)
    model = as_drawn(closed)
    request = FrfRequest(
        FREQ,
        tuple(parse_output(axis, text) for text in ("acc2:+tx", "encoder")),
        tuple(parse_input(axis, text) for text in ("drive", "hit1:+tz")),
        "mobility",
    )
    system = state_space(model, model.drawn, request)
    values = Evaluator(model, request).at(model.drawn).values
    expected = np.moveaxis(system(S), -1, 0)
    peak = np.abs(values).max(axis=(0, 2))
    assert (np.abs(values - expected).max(axis=(0, 2)) < 1e-5 * peak).all()
    assert any("servo" in name for name in system.state_labels)


def test_modes_with_delays_fulfil_the_exact_equation(axis, loops):
    closed = with_loops(axis, loops)
    model = as_drawn(closed)
    modes = model_modes(model, model.drawn)
    assembly = model.assemble(model.drawn)
    for pole, shape in zip(modes.poles, modes.shapes.T, strict=True):
        stiffness = assembly.matrices.dynamic_stiffness(pole)
        terms = (assembly.matrices.stiffness, assembly.matrices.damping, assembly.matrices.mass)
        sizes = sum(np.abs(pole**k * term) for k, term in enumerate(terms)) @ np.abs(shape)
        for term in assembly.frequency_dependent:
            added = term.left @ term.at(np.array([pole]))[0] @ term.right.T
            stiffness = stiffness + added
            sizes = sizes + np.abs(added) @ np.abs(shape)
        assert np.abs(stiffness @ shape).max() < 1e-8 * sizes.max()
    assert modes.oscillates.sum() >= 5


def test_modes_that_coincide_beside_a_loop_are_all_listed(from_text):
    block = (
        '<body name="b{n}" pos="{n} 0 0"><joint name="b{n}_tx" type="slide" axis="1 0 0" '
        'stiffness="1e5" damping="20"/><inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/></body>'
    )
    machine = from_text(
        '<mujoco><option gravity="0 0 0"/><worldbody>'
        + "".join(block.format(n=n) for n in range(3))
        + '</worldbody><actuator><motor name="drive" joint="b2_tx"/></actuator></mujoco>'
    )
    loop = loop_on(machine, "servo", "drive", [("joint:b2_tx", 1.0)], pd(), 2e-4)
    model = as_drawn(with_loops(machine, [loop]))
    modes = model_modes(model, model.drawn)
    alone = np.roots([3.0, 20.0, 1e5])
    assert (np.abs(modes.poles - alone[alone.imag > 0]) < 1e-6 * abs(alone[0])).sum() == 2


def test_derivatives_of_poles_and_shapes_follow_the_loops(axis, loops):
    model = toleranced(with_loops(axis, loops))
    outputs = tuple(parse_output(axis, text) for text in ("acc1:+tx", "acc2:+tx", "acc2:+tz"))
    evaluator, theta = ModeEvaluator(model, outputs), model.drawn
    modes = evaluator.at(theta)
    chosen = np.flatnonzero(modes.modes.oscillates)[:3]
    start = modes.modes.poles[chosen]
    weights = np.array([1.0 + 0.5j, -0.3 + 1j, 0.7])
    gradient = modes.gradient(chosen, weights, np.zeros((3, 3), complex))

    def cost(moved):
        poles = evaluator.at(moved).modes.poles
        near = np.array([poles[np.abs(poles - pole).argmin()] for pole in start])
        return (weights.conj() * near).sum().real

    expected = differences(cost, theta, steps_of(model, theta))
    size = steps_of(model, theta)
    assert np.abs((gradient - expected) * size).max() < 1e-6 * np.abs(expected * size).max()


def test_a_loop_that_integrates_holds_a_machine_at_rest(from_text):
    machine = from_text(MASS_ON_SPRING.format(m=2.0, c=0.0, k=0.0))
    pid = controller_from_roots([-20.0, -60.0], [0.0, -3e3], 200.0 * 3e3)
    loop = loop_on(machine, "servo", "drive", [("joint:block_tx", 1.0)], pid)
    closed = with_loops(machine, [loop])
    modes = model_modes(as_drawn(closed), np.zeros(0))
    assert not any(modes.names), "nothing is at rest once the loop holds it"
    assert (modes.poles.real < 0).all()
    sprung = from_text(MASS_ON_SPRING.format(m=2.0, c=5.0, k=1e4))
    held = frfs(with_loops(sprung, [loop]), ["block:+tx"], ["block:+tx"], np.array([0.0, 1.0]))
    assert abs(held[0, 0, 0]) < 1e-6 * abs(held[1, 0, 0]), "an integrator leaves no static error"


def test_a_loop_on_forces_and_an_unknown_port_are_refused(from_text):
    text = MASS_ON_SPRING.format(m=2.0, c=5.0, k=1e4).replace(
        "</mujoco>", '<sensor><force name="strut" site="acc1"/></sensor></mujoco>'
    )
    machine = from_text(text)
    with pytest.raises(UsageError, match="name a motion"):
        with_loops(machine, [loop_on(machine, "f", "drive", [("strut", 1.0)], pd())])
    gain = Controller(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[1.0]]))
    other = from_text(MASS_ON_SPRING.format(m=1.0, c=1.0, k=1.0).replace("drive", "coil"))
    with pytest.raises(UsageError, match="drive"):
        with_loops(other, [loop_on(machine, "f", "drive", [("acc1:+tx", 1.0)], gain)])
