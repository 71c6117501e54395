"""Margins of a budget's loops: against python-control, samples, and plants at their weight."""

from dataclasses import replace
from types import SimpleNamespace

import control
import numpy as np
import pytest
from budget_case import BUDGET, FLOOR, FLOOR_HZ, TWO, VALUES

from identification.words import parse_port
from mbmodel import FrfRequest, ParameterPosterior, frf_bands, load_machine, machine_model
from tuning import LevelFrfs, TuningResult
from tuning.assessment.multiplicative_error import held_out_loop_error
from tuning.error_budget.budget import error_budget
from tuning.error_budget.closed_loop_states import loop_states
from tuning.error_budget.loop_margins import closed_loops, plant_margins
from tuning.error_budget.loop_plant import LoopPlant
from tuning.error_budget.plant_budget import plant_budget
from tuning.error_budget.read_definition import read_definition
from tuning.error_budget.robust_stability import FLOOR as FLOOR_WEIGHT
from tuning.error_budget.robust_stability import HELD_OUT

DELAY = 3e-4
SECOND = """
[loop.base]
input = "acc1:+tx"
output = "acc1:+tx"
quantity = "mobility"
controller = { poles = [-400.0], gain = 4e5 }
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("margins")
    (place / "two.xml").write_text(TWO.format(**VALUES), encoding="utf-8")
    rows = "\n".join(f"{f};{s}" for f, s in zip(FLOOR_HZ, FLOOR, strict=True))
    (place / "floor.csv").write_text(f"f;x [(m/s^2)^2/Hz]\n{rows}\n", encoding="utf-8")
    return place


@pytest.fixture(scope="module")
def model(folder):
    return machine_model(load_machine(folder / "two.xml"))


def posterior_of(model, deviation=0.03, discrepancy=0.01):
    """All springs and dampers, independent."""
    names = tuple(parameter.name for parameter in model.parameters[:4])
    return ParameterPosterior(
        names, names, model.drawn[:4], np.arange(4), np.ones(4), np.ones(4, bool),
        deviation**2 * np.eye(4), 0.02, discrepancy,
    ).on(model)  # fmt: skip


def definition_of(folder, model, extra="", gain=3e5):
    file = folder / "budget.toml"
    file.write_text(BUDGET.format(gain=gain, delay=DELAY, lines="") + extra, encoding="utf-8")
    return read_definition(file, model.machine)


def margins_of(budget, **known):
    plant = LoopPlant.of(budget.linearised.model, budget.definition)
    return plant_margins(plant, budget.linearised.theta, **known)


def open_loop(theta=None):
    """GK of both loops by hand as a function of s: axis, then base."""
    m1, k1, c1, m2, k2, c2 = VALUES.values() if theta is None else theta

    def gain_of(s):
        dynamic = np.array(
            [
                [m1 * s**2 + (c1 + c2) * s + k1 + k2, -c2 * s - k2],
                [-c2 * s - k2, m2 * s**2 + c2 * s + k2],
            ]
        )
        forces = np.array([[-2.0, 1.0], [2.0, 0.0]])  # drive has a gear of 2
        reading = np.array([[-1.0, 1.0], [s, 0.0]])
        axis = 3e5 * (s + 60) * (s + 8) / ((s + 0.5) * (s + 700)) * np.exp(-s * DELAY)
        return reading @ np.linalg.solve(dynamic, forces) * np.array([axis, 4e5 / (s + 400)])

    return gain_of


def values_at(freq, theta=None):
    gain_of = open_loop(theta)
    return np.array([gain_of(2j * np.pi * f) for f in freq])


def test_the_loop_gain_of_a_machine_has_the_margins_of_python_control(folder, model):
    budget = error_budget(model, model.drawn, definition_of(folder, model))
    found = margins_of(budget).nominal
    np.testing.assert_allclose(found.gains[:, 0, 0], values_at(found.freq_hz)[:, 0, 0], rtol=1e-8)
    # python-control interpolates data: phase and distance, on lines that are far denser
    freq = np.geomspace(0.1, 2e3, 20_000)
    data = control.frd(values_at(freq)[:, 0, 0], 2 * np.pi * freq)
    _, phases, distances, _, at_phase, _ = control.stability_margins(data, returnall=True)
    loop = found.loops[0]
    assert loop.modulus.value == pytest.approx(distances.min(), rel=1e-5)
    best = np.argmin(np.abs(phases))
    assert loop.phase.value == pytest.approx(phases[best], rel=1e-4)
    np.testing.assert_allclose(
        loop.gain_crossovers[:, 0], np.sort(at_phase) / (2 * np.pi), rtol=1e-4
    )
    crossing = values_at([loop.gain.freq_hz])[0, 0, 0]
    assert crossing.imag == pytest.approx(0.0, abs=1e-9)
    assert -1 / crossing.real == pytest.approx(loop.gain.value, rel=1e-8)


def growth(folder, model, gain=1.0, delay=0.0):
    """Largest real part of the poles with another gain and a further delay of the axis."""
    definition = definition_of(folder, model, gain=3e5 * gain)
    loops = tuple(replace(loop, delay=loop.delay + delay) for loop in definition.loops)
    definition = replace(definition, loops=loops)
    budget = error_budget(model, model.drawn, definition_of(folder, model))
    return loop_states(model, model.drawn, definition, budget.ports).poles().real.max()


def test_the_poles_reach_the_axis_at_gain_and_delay_margin(folder, model):
    loop = margins_of(error_budget(model, model.drawn, definition_of(folder, model))).nominal.loops[
        0
    ]
    for name, size in (("gain", loop.gain.value), ("delay", loop.delay.value)):
        below, above = (
            growth(folder, model, **{name: 1 + (size - 1) * s if name == "gain" else size * s})
            for s in (0.99, 1.01)
        )
        assert below < 0 < above


def test_two_loops_are_those_of_matrices_by_hand(folder, model):
    budget = error_budget(model, model.drawn, definition_of(folder, model, SECOND))
    margins = margins_of(budget)
    found = margins.nominal
    assert margins.names == ("axis", "base")
    np.testing.assert_allclose(found.gains, values_at(found.freq_hz), rtol=1e-7, atol=1e-12)
    dense = values_at(np.geomspace(0.1, 2e3, 20_000))
    axis, base = dense[:, 0, 0], dense[:, 1, 1]
    cross = dense[:, 0, 1] * dense[:, 1, 0]
    for number, (own, other) in enumerate(((axis, base), (base, axis))):
        single = own - cross / (1 + other)  # with the other loop closed
        distance = np.abs(1 + single).min()
        assert found.loops[number].modulus.value == pytest.approx(distance, rel=1e-4)


def test_samples_of_the_posterior_have_margins_of_their_own(folder, model):
    posterior = posterior_of(model)
    plant = plant_budget(model, definition_of(folder, model), None, posterior)
    margins = plant.margins
    assert len(margins.samples) == 60
    worst = margins.worst_sample(0)
    distances = []
    for theta in plant.thetas:
        k1, c1, k2, c2 = theta[:4]
        by_hand = values_at(
            np.geomspace(10.0, 200.0, 6000), (VALUES["m1"], k1, c1, VALUES["m2"], k2, c2)
        )
        distances.append(np.abs(1 + by_hand[:, 0, 0]).min())
    shown = [sample.loops[0].modulus.value for sample in margins.samples]
    assert shown == pytest.approx(distances, rel=1e-4)
    assert worst == int(np.argmin(distances))


def test_the_floor_is_the_error_of_the_plant_that_its_bands_have(folder, model):
    posterior = posterior_of(model, 0.0)
    plant = plant_budget(model, definition_of(folder, model), None, posterior)
    (test,) = plant.margins.robust[0]
    assert test.weight == FLOOR_WEIGHT
    layout = model.machine.layout
    ports = ((parse_port("acc2-acc1:+tx", layout.points),), (parse_port("drive", layout.points),))
    freq = plant.margins.nominal.freq_hz
    bands = frf_bands(posterior, FrfRequest(freq, *ports, "receptance"))
    error = np.sqrt(2 * -np.log(0.05)) * bands.model_error[:, 0, 0]
    gain = values_at(freq)[:, 0, 0]
    change = error / np.abs(bands.values[:, 0, 0]) * np.abs(gain / (1 + gain))
    assert test.peak == pytest.approx(change.max(), rel=1e-6)
    assert test.freq_hz == pytest.approx(freq[change.argmax()])
    again = plant.margins.robust_at_once[0]
    assert again.peak == pytest.approx(test.peak, rel=1e-6)


LINES = np.arange(5.0, 60.0, 0.5)


def tuning_with(error, *, has_own, inputs=("acc1:+tx", "acc1:+ty")):
    """A tuning whose held-out predictions are off by a relative error."""
    random = np.random.default_rng(1)
    channels = [("acc2:+tx", inputs[0]), ("acc1:+tx", inputs[0]), ("acc2:+tx", inputs[1])]
    channels.append(("acc1:+tx", inputs[1]))
    if has_own:
        channels += [("acc2:+tx", "drive"), ("acc1:+tx", "drive")]
    shape = (len(LINES), len(channels))
    model = random.normal(size=shape) + 1j * random.normal(size=shape)
    frfs = LevelFrfs(
        tuple(output for output, _ in channels),
        tuple(f"{reference} in hits.uff" for _, reference in channels),
        model * (1 + error[:, None]), model, model, np.zeros(shape), held_out=model,
    )  # fmt: skip
    return TuningResult(SimpleNamespace(held_out_blocks=[None] * 10), LINES, {"sensors": frfs})


@pytest.mark.parametrize("has_own", [True, False])
def test_a_plant_that_errs_by_the_weight_is_critical_where_it_reaches_one(folder, model, has_own):
    loop_gain = values_at(LINES)[:, 0, 0]
    closed = loop_gain / (1 + loop_gain)
    error = np.full(len(LINES), 0.2)
    budget = error_budget(model, model.drawn, definition_of(folder, model))
    result = tuning_with(error, has_own=has_own)
    (test,) = margins_of(budget, tuning=result).robust[0]
    assert test.weight == HELD_OUT
    assert test.band == (LINES[0], LINES[-1])
    assert test.peak == pytest.approx(0.2 * np.abs(closed).max(), rel=1e-3)
    # a plant off by 0.2 / peak, in the worst phase, has the critical point on its loop gain
    gain = values_at([test.freq_hz])[0, 0, 0]
    turned = -(1 + gain) / gain
    assert abs(turned) == pytest.approx(0.2 / test.peak, rel=1e-6)
    assert abs(1 + gain * (1 + turned)) < 1e-9


def test_the_own_plant_of_a_loop_counts_before_the_error_at_the_inputs(folder, model):
    (loop,) = definition_of(folder, model).loops
    error = 0.1 * np.exp(1j * LINES)
    own = held_out_loop_error(tuning_with(error, has_own=True), loop)
    np.testing.assert_allclose(own.errors, 0.1 * np.ones((1, len(LINES))), rtol=1e-9)
    other = held_out_loop_error(tuning_with(error, has_own=False), loop)
    np.testing.assert_allclose(other.errors, 0.1 * np.ones((1, len(LINES))), rtol=1e-6)
    # inputs of different units have no common error
    mixed = tuning_with(error, has_own=False, inputs=("acc1:+tx", "acc1:+rz"))
    assert held_out_loop_error(mixed, loop) is None
    budget = error_budget(model, model.drawn, definition_of(folder, model))
    assert margins_of(budget, tuning=mixed).robust == ((),)


def test_unstable_machines_of_the_posterior_are_counted_and_have_no_margins(folder, model):
    definition = definition_of(folder, model, gain=9e5)
    late = tuple(replace(loop, delay=2.2e-3) for loop in definition.loops)
    plant = LoopPlant.of(model, replace(definition, loops=late))
    posterior = posterior_of(model, 0.3, 0.0)
    thetas = posterior.sample(40, seed=1)
    shown = closed_loops(plant, model.drawn, posterior, thetas)
    growth = [plant.poles(theta, is_closed=True).real.max() for theta in thetas]
    assert shown.unstable_samples == sum(rate > 0 for rate in growth) > 0
    assert shown.samples == 40
    assert len(shown.margins.samples) == 40 - shown.unstable_samples
    hot = tuple(replace(loop, delay=9e-3) for loop in definition.loops)
    plant = LoopPlant.of(model, replace(definition, loops=hot))
    assert closed_loops(plant, model.drawn).margins is None
