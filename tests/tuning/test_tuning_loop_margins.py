"""Margins of loops around a machine: against python-control, by hand, and over samples."""

from dataclasses import replace

import control
import numpy as np
import pytest
from budget_case import (
    SECOND_LOOP,
    VALUES,
    loop_definition,
    loop_gain_by_hand,
    margins_of,
    spring_posterior,
    write_machine,
)

from mbmodel import load_machine, machine_model
from tuning.plant.error_budget.budget import error_budget
from tuning.plant.error_budget.closed_loop_states import loop_states
from tuning.plant.error_budget.loop_margins import closed_loops
from tuning.plant.error_budget.loop_plant import LoopPlant
from tuning.plant.error_budget.machine_files import FittedMachine
from tuning.plant.error_budget.plant_budget import plant_budget


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_machine(tmp_path_factory.mktemp("margins"))


@pytest.fixture(scope="module")
def model(folder):
    return machine_model(load_machine(folder / "two.xml"))


def test_the_loop_gain_of_a_machine_has_the_margins_of_python_control(folder, model):
    budget = error_budget(model, model.drawn, loop_definition(folder, model))
    nominal = margins_of(budget).nominal
    np.testing.assert_allclose(
        nominal.gains[:, 0, 0], loop_gain_by_hand(nominal.freq_hz)[:, 0, 0], rtol=1e-8
    )
    # python-control interpolates data: phase and distance, on lines that are far denser
    freq = np.geomspace(0.1, 2e3, 20_000)
    data = control.frd(loop_gain_by_hand(freq)[:, 0, 0], 2 * np.pi * freq)
    _, phases, distances, _, at_phase, _ = control.stability_margins(data, returnall=True)
    loop = nominal.loops[0]
    assert loop.modulus.value == pytest.approx(distances.min(), rel=1e-5)
    best = np.argmin(np.abs(phases))
    assert loop.phase.value == pytest.approx(phases[best], rel=1e-4)
    np.testing.assert_allclose(
        loop.gain_crossovers[:, 0], np.sort(at_phase) / (2 * np.pi), rtol=1e-4
    )
    crossing = loop_gain_by_hand([loop.gain.freq_hz])[0, 0, 0]
    assert crossing.imag == pytest.approx(0.0, abs=1e-9)
    assert -1 / crossing.real == pytest.approx(loop.gain.value, rel=1e-8)


def growth(folder, model, gain=1.0, delay=0.0):
    """Largest real part of the poles with another gain and a further delay of the axis."""
    definition = loop_definition(folder, model, gain=3e5 * gain)
    loops = tuple(replace(loop, delay=loop.delay + delay) for loop in definition.loops)
    definition = replace(definition, loops=loops)
    budget = error_budget(model, model.drawn, loop_definition(folder, model))
    return loop_states(model, model.drawn, definition, budget.ports).poles().real.max()


def test_the_poles_reach_the_axis_at_gain_and_delay_margin(folder, model):
    loop = margins_of(
        error_budget(model, model.drawn, loop_definition(folder, model))
    ).nominal.loops[0]
    for name, size in (("gain", loop.gain.value), ("delay", loop.delay.value)):
        below, above = (
            growth(folder, model, **{name: 1 + (size - 1) * s if name == "gain" else size * s})
            for s in (0.99, 1.01)
        )
        assert below < 0 < above


def test_two_loops_are_those_of_matrices_by_hand(folder, model):
    budget = error_budget(model, model.drawn, loop_definition(folder, model, SECOND_LOOP))
    margins = margins_of(budget)
    nominal = margins.nominal
    assert margins.names == ("axis", "base")
    np.testing.assert_allclose(
        nominal.gains, loop_gain_by_hand(nominal.freq_hz), rtol=1e-7, atol=1e-12
    )
    dense = loop_gain_by_hand(np.geomspace(0.1, 2e3, 20_000))
    axis, base = dense[:, 0, 0], dense[:, 1, 1]
    cross = dense[:, 0, 1] * dense[:, 1, 0]
    for number, (own, other) in enumerate(((axis, base), (base, axis))):
        single = own - cross / (1 + other)  # with the other loop closed
        distance = np.abs(1 + single).min()
        assert nominal.loops[number].modulus.value == pytest.approx(distance, rel=1e-4)


def test_samples_of_the_posterior_have_margins_of_their_own(folder, model):
    posterior = spring_posterior(model)
    plant = plant_budget(FittedMachine(model, posterior), loop_definition(folder, model))
    margins = plant.margins
    assert len(margins.samples) == 60
    worst = margins.worst_sample(0)
    distances = []
    for theta in plant.fitted.thetas:
        k1, c1, k2, c2 = theta[:4]
        by_hand = loop_gain_by_hand(
            np.geomspace(10.0, 200.0, 6000), (VALUES["m1"], k1, c1, VALUES["m2"], k2, c2)
        )
        distances.append(np.abs(1 + by_hand[:, 0, 0]).min())
    shown = [sample.loops[0].modulus.value for sample in margins.samples]
    assert shown == pytest.approx(distances, rel=1e-4)
    assert worst == int(np.argmin(distances))


def test_unstable_machines_of_the_posterior_are_counted_and_have_no_margins(folder, model):
    definition = loop_definition(folder, model, gain=9e5)
    late = tuple(replace(loop, delay=2.2e-3) for loop in definition.loops)
    plant = LoopPlant.of(model, replace(definition, loops=late))
    posterior = spring_posterior(model, 0.3, 0.0)
    thetas = posterior.sample(40, seed=1)
    shown = closed_loops(plant, model.drawn, posterior, thetas)
    growth = [plant.poles(theta, is_closed=True).real.max() for theta in thetas]
    assert shown.unstable_samples == sum(rate > 0 for rate in growth) > 0
    assert shown.samples == 40
    assert len(shown.margins.samples) == 40 - shown.unstable_samples
    hot = tuple(replace(loop, delay=9e-3) for loop in definition.loops)
    plant = LoopPlant.of(model, replace(definition, loops=hot))
    assert closed_loops(plant, model.drawn).margins is None
