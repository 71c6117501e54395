"""Steps of a loop's reference against python-control, and their times against closed forms."""

import control
import numpy as np
import pytest
from budget_case import SECOND_LOOP, VALUES, loop_definition, write_machine

from mbmodel import as_drawn, load_machine
from tuning.plant.error_budget.loop_margins import plant_margins
from tuning.plant.error_budget.loop_plant import LoopPlant
from tuning.plant.error_budget.reference_step import ReferenceStep, reference_steps


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_machine(tmp_path_factory.mktemp("step"))


def plant_by_hand():
    """Axis and base by python-control: relative position by the drive, velocity by a force."""
    m1, k1, c1, m2, k2, c2 = VALUES.values()
    inverse = np.diag([1 / m1, 1 / m2])
    stiffness = np.array([[k1 + k2, -k2], [-k2, k2]])
    damping = np.array([[c1 + c2, -c2], [-c2, c2]])
    a = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ stiffness, -inverse @ damping]])
    b = np.vstack([np.zeros((2, 2)), inverse @ np.array([[-2.0, 1.0], [2.0, 0.0]])])
    return control.ss(a, b, [[-1.0, 1.0, 0, 0], [0, 0, 1.0, 0]], np.zeros((2, 2)))


@pytest.mark.parametrize("extra", ["", SECOND_LOOP])
def test_a_step_is_that_of_python_control(folder, extra):
    model = as_drawn(load_machine(folder / "two.xml"))
    plant = LoopPlant.of(model, loop_definition(folder, model, extra))
    margins = plant_margins(plant, model.drawn).nominal
    step = reference_steps(plant, model.drawn, margins)[0]
    s = control.tf("s")
    delay = control.tf(*control.pade(3e-4, 5))
    axis = control.ss(3e5 * (s + 60) * (s + 8) / ((s + 0.5) * (s + 700)) * delay)
    base = control.ss(4e5 / (s + 400)) if extra else control.ss([], [], [], [[0.0]])
    gain = plant_by_hand() * control.append(axis, base)
    closed = control.feedback(gain, np.eye(2))
    expected = control.forced_response(
        closed, step.time_s, np.vstack([np.ones_like(step.time_s), 0 * step.time_s])
    )
    np.testing.assert_allclose(step.response, expected.outputs[0], atol=2e-4)
    assert step.final == pytest.approx(closed.dcgain()[0, 0], rel=1e-6)


def test_a_loop_without_a_crossover_follows_no_reference(folder):
    model = as_drawn(load_machine(folder / "two.xml"))
    plant = LoopPlant.of(model, loop_definition(folder, model, SECOND_LOOP))
    margins = plant_margins(plant, model.drawn).nominal
    assert not margins.loops[1].crossover.is_finite
    assert reference_steps(plant, model.drawn, margins)[1] is None


def test_a_loop_without_gain_at_rest_follows_no_reference(folder):
    # The velocity of the base: its plant is 0 at 0 Hz, whatever its gain, so T(0) = 0.
    model = as_drawn(load_machine(folder / "two.xml"))
    strong = SECOND_LOOP.replace("gain = 4e5", "gain = 4e7")
    assert strong != SECOND_LOOP
    plant = LoopPlant.of(model, loop_definition(folder, model, strong))
    margins = plant_margins(plant, model.drawn)
    assert margins.nominal.loops[1].crossover.is_finite
    assert margins.steps[1] is None
    assert [text for text in margins.sentences() if "vanishes at 0 Hz" in text]


def test_times_and_overshoot_are_those_of_first_and_second_order():
    time = np.linspace(0.0, 10.0, 20_001)
    first = ReferenceStep(time, 3 * (1 - np.exp(-time / 0.4)), 3.0)
    assert first.rise_time_s == pytest.approx(0.4 * np.log(9), rel=1e-4)
    assert first.settling_time_s == pytest.approx(0.4 * np.log(50), abs=1e-3)
    assert first.overshoot == 0.0
    ratio, omega = 0.3, 5.0
    turning = omega * np.sqrt(1 - ratio**2)
    decay = np.exp(-ratio * omega * time)
    wave = np.cos(turning * time) + ratio / np.sqrt(1 - ratio**2) * np.sin(turning * time)
    second = ReferenceStep(time, 1 - decay * wave, 1.0)
    peak = np.exp(-np.pi * ratio / np.sqrt(1 - ratio**2))
    assert second.overshoot == pytest.approx(peak, rel=1e-5)
    short = ReferenceStep(time[:200], (1 - decay * wave)[:200], 1.0)
    assert short.rise_time_s is None
    assert short.settling_time_s is None
