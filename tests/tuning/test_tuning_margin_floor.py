"""Deviations of margins by the model-error floor, against loop gains that err at random."""

from dataclasses import replace

import numpy as np
import pytest
from budget_case import (
    loop_definition,
    loop_gain_by_hand,
    spring_posterior,
    write_machine,
)

from mbmodel import load_machine, machine_model
from mbw.plant.margin_rows import margins_row
from tuning.plant.control_loops.stability_margins import stability_margins
from tuning.plant.error_budget.machine_files import FittedMachine
from tuning.plant.error_budget.plant_budget import plant_budget
from tuning.plant.error_budget.robust_stability import margin_deviations

NAMES = ("crossover", "bandwidth", "gain", "phase", "delay", "modulus")
LINES = np.geomspace(0.05, 2000.0, 400)


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    folder = write_machine(tmp_path_factory.mktemp("floor"))
    model = machine_model(load_machine(folder / "two.xml"))
    fitted = FittedMachine(model, spring_posterior(model, 0.01))
    return plant_budget(fitted, loop_definition(folder, model))


def test_deviations_are_those_of_loop_gains_that_err_at_random():
    size, random = 0.01, np.random.default_rng(4)
    nominal = stability_margins(loop_gain_of(0.0), LINES).loops[0]

    def deviation_of(freq):
        return size / np.sqrt(2) * np.abs(loop_gain_of(0.0)(freq)[:, 0])

    known = margin_deviations(loop_gain_of(0.0), deviation_of, 0, nominal)
    errors = size / np.sqrt(2) * (random.normal(size=400) + 1j * random.normal(size=400))
    drawn = [stability_margins(loop_gain_of(error), LINES).loops[0] for error in errors]
    for name in NAMES:
        values = np.array([getattr(each, name).value for each in drawn])
        spread = values.std() if name == "phase" else np.log(values).std()
        assert known[name] == pytest.approx(spread, rel=0.15), name
    assert "reduction" not in known


def loop_gain_of(error):
    """The loop of the axis by hand, with a relative error."""

    def gain_of(freq):
        return (1 + error) * loop_gain_by_hand(freq)[:, :1, :1]

    return gain_of


def test_intervals_hold_the_floor_beside_the_posterior(plant):
    margins = plant.margins
    row = margins_row(margins).loops[0]
    deviation = margins.by_floor[0]
    values = np.array([each.loops[0].modulus.value for each in margins.samples])
    ends = np.quantile(values, [0.025, 0.975])
    modulus = row.modulus
    assert modulus.floor == pytest.approx(deviation["modulus"] * modulus.value)
    half = np.hypot(np.log(modulus.value / ends[0]), 1.96 * deviation["modulus"])
    assert modulus.low == pytest.approx(modulus.value * np.exp(-half), rel=0.01)
    phases = np.array([each.loops[0].phase.value for each in margins.samples])
    half = np.hypot(np.quantile(phases, 0.975) - row.phase.value, 1.96 * deviation["phase"])
    assert row.phase.high == pytest.approx(row.phase.value + half, rel=0.01)
    assert row.phase.worst in phases


def test_without_a_model_error_intervals_are_those_of_the_posterior(plant):
    alone = margins_row(replace(plant.margins, by_floor=())).loops[0]
    values = [each.loops[0].gain.value for each in plant.margins.samples]
    assert alone.gain.low == pytest.approx(np.quantile(values, 0.025, method="lower"))
    assert alone.gain.floor is None
