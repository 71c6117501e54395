"""Sampled controllers of loops that were closed in a test: closed forms, modes and states."""

import control
import numpy as np
import pytest

from identification.readers.controller import controller_from_roots
from identification.words import Controller, Loop, PortSum, UsageError
from mbmodel import (
    Evaluator,
    FrfRequest,
    as_drawn,
    export_state_space,
    model_modes,
    parse_input,
    parse_output,
    with_loops,
)
from mbmodel.control_loops.loop_law import continuous_equivalent
from mbmodel.export.discrete import SystemMatrices, discretise

MASS, STIFFNESS, DAMPING = 8.0, 2e5, 30.0  # 25 Hz
PERIOD, DELAY = 1e-3, 4e-4
BLOCK = f"""<mujoco><option gravity="0 0 0"/><worldbody><body name="block">
<joint name="block_tx" type="slide" axis="1 0 0" stiffness="{STIFFNESS}" damping="{DAMPING}"/>
<inertial pos="0 0 0" mass="{MASS}" diaginertia="1 1 1"/><site name="acc1"/></body></worldbody>
<actuator><motor name="drive" joint="block_tx"/></actuator></mujoco>"""
FREQ = np.linspace(2.0, 100.0, 99)
S = 2j * np.pi * FREQ
# A proportional part, a derivative with a filter, and an integrator.
ZEROS, POLES, GAIN = [0.96, 0.9995], [0.3, 1.0], 5e5


def servo(machine, controller, delay=DELAY):
    measured = PortSum("servo", ((parse_output(machine, "joint:block_tx"), 1.0),), "m", 0)
    return Loop("servo", parse_input(machine, "drive"), measured, controller, "N", delay)


@pytest.fixture
def closed(from_text):
    machine = from_text(BLOCK)
    controller = controller_from_roots(ZEROS, POLES, GAIN, PERIOD)
    return with_loops(machine, [servo(machine, controller)])


def request_of(machine, freq=FREQ):
    port = parse_output(machine, "block:+tx"), parse_input(machine, "block:+tx")
    return FrfRequest(freq, port[:1], port[1:], "receptance")


def law(s):
    z = np.exp(s * PERIOD)
    gain = GAIN * np.prod([z - each for each in ZEROS], 0) / np.prod([z - p for p in POLES], 0)
    return gain, -np.expm1(-s * PERIOD) / (s * PERIOD) * np.exp(-s * DELAY)


def plant(s):
    return 1 / (MASS * s**2 + DAMPING * s + STIFFNESS)


def test_the_frf_is_the_closed_form_and_nearly_that_of_all_images(closed):
    model = as_drawn(closed)
    values = Evaluator(model, request_of(closed)).at(model.drawn).values[:, 0, 0]
    gain, held = law(S)
    assert np.abs(values * (1 / plant(S) + gain * held) - 1).max() < 1e-9
    images = sum(plant(S + 2j * np.pi * k / PERIOD) * law(S + 2j * np.pi * k / PERIOD)[1]
                 for k in range(-400, 401))  # fmt: skip
    exact = plant(S) - plant(S) * held * gain / (1 + images * gain) * plant(S)
    error = np.abs(values / exact - 1)
    assert error.max() < 0.6 * (FREQ.max() * PERIOD) ** 2
    assert error[FREQ < 50].max() < 1e-3
    assert np.abs(values / plant(S) - 1).max() > 0.3, "the loop matters"


def test_modes_are_nearly_the_poles_of_the_sampled_loop(closed):
    dynamics = np.array([[0, 1], [-STIFFNESS / MASS, -DAMPING / MASS]])
    block = SystemMatrices(
        dynamics, np.array([[0], [1 / MASS]]), np.array([[1.0, 0]]), np.zeros((1, 1))
    )
    held = discretise(block, PERIOD, np.array([DELAY])).system
    sampled = control.ss(held.a, held.b, held.c, held.d, PERIOD)
    loop = control.ss(control.zpk(ZEROS, POLES, GAIN, dt=PERIOD)) * sampled
    poles = np.log(control.feedback(loop, 1).poles().astype(complex)) / PERIOD
    expected = min(poles[poles.imag > 1], key=abs)
    modal_poles = model_modes(as_drawn(closed), as_drawn(closed).drawn).poles
    nearest = modal_poles[np.argmin(np.abs(modal_poles - expected))]
    assert nearest == pytest.approx(expected, rel=3e-4)


def test_the_state_space_states_its_error(closed):
    model = as_drawn(closed)
    export = export_state_space(model, model.drawn, request_of(closed))
    (law,) = export.laws
    assert law.approximation.kind == "tustin"
    assert law.approximation.max_error < 0.05
    exact = Evaluator(model, request_of(closed)).at(model.drawn).values[:, 0, 0]
    assert np.abs(export.system(S) / exact - 1).max() < 0.05


def test_tustins_rule_there_and_back_is_the_controller():
    sampled = controller_from_roots([0.9, 0.2], [0.5, 0.999, 0.1], 7.0, PERIOD)
    continuous = continuous_equivalent(sampled)
    assert continuous.period_s == 0
    again = control.sample_system(
        control.ss(
            continuous.dynamics,
            continuous.input_matrix,
            continuous.output_matrix,
            continuous.feedthrough,
        ),
        PERIOD,
        "tustin",
    )
    z = np.exp(2j * np.pi * np.array([1.0, 30.0, 200.0, 450.0]) * PERIOD)
    expected = control.zpk([0.9, 0.2], [0.5, 0.999, 0.1], 7.0, dt=PERIOD)(z)
    assert again(z) == pytest.approx(expected, rel=1e-9)
    assert continuous_equivalent(continuous) is continuous


def test_a_pole_at_minus_one_is_refused_by_the_name_of_its_loop(from_text):
    machine = from_text(BLOCK)
    wild = Controller(
        np.array([[-1.0]]), np.array([[1.0]]), np.array([[1.0]]), np.zeros((1, 1)), PERIOD
    )
    with pytest.raises(UsageError, match=r"loop 'servo': the sampled controller has a pole at z"):
        with_loops(machine, [servo(machine, wild)])
