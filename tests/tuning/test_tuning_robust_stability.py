"""Robust stability: plants at their weight are critical, and random machines keep to the floor."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from budget_case import (
    LOOP_DELAY,
    SECOND_LOOP,
    VALUES,
    loop_definition,
    loop_gain_by_hand,
    margins_of,
    spring_posterior,
    write_machine,
)
from scipy.linalg import eigh

from identification.words import parse_port
from mbmodel import FrfRequest, load_machine, machine_model
from mbw.plant.margin_rows import margins_row
from mbw.plant.margin_sentences import robust_sentence
from tuning import LevelFrfs, TuningResult
from tuning.plant import frf_bands
from tuning.plant.error_budget.budget import error_budget
from tuning.plant.error_budget.machine_files import FittedMachine
from tuning.plant.error_budget.plant_budget import plant_budget
from tuning.plant.error_budget.robust_stability import FLOOR as FLOOR_WEIGHT
from tuning.plant.error_budget.robust_stability import HELD_OUT
from tuning.plant.uncertainty.multiplicative_error import held_out_loop_error


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_machine(tmp_path_factory.mktemp("margins"))


@pytest.fixture(scope="module")
def model(folder):
    return machine_model(load_machine(folder / "two.xml"))


def test_the_floor_is_the_error_of_the_plant_that_its_bands_have(folder, model):
    posterior = spring_posterior(model, 0.0)
    plant = plant_budget(FittedMachine(model, posterior), loop_definition(folder, model))
    (test,) = plant.margins.robust[0]
    assert test.weight == FLOOR_WEIGHT
    layout = model.machine.layout
    ports = ((parse_port("acc2-acc1:+tx", layout.points),), (parse_port("drive", layout.points),))
    freq = plant.margins.nominal.freq_hz
    bands = frf_bands(posterior, FrfRequest(freq, *ports, "receptance"))
    error = np.sqrt(2 * -np.log(0.05)) * bands.model_error[:, 0, 0]
    gain = loop_gain_by_hand(freq)[:, 0, 0]
    change = error / np.abs(bands.values[:, 0, 0]) * np.abs(gain / (1 + gain))
    assert test.peak == pytest.approx(change.max(), rel=1e-6)
    assert test.frequency == pytest.approx(freq[change.argmax()])
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
    loop_gain = loop_gain_by_hand(np.linspace(LINES[0], LINES[-1], 20_000))[:, 0, 0]
    closed = loop_gain / (1 + loop_gain)
    error = np.full(len(LINES), 0.2)
    budget = error_budget(model, model.drawn, loop_definition(folder, model))
    result = tuning_with(error, has_own=has_own)
    (test,) = margins_of(budget, tuning=result).robust[0]
    assert test.weight == HELD_OUT
    assert test.band == (LINES[0], LINES[-1])
    assert test.peak == pytest.approx(0.2 * np.abs(closed).max(), rel=1e-3)
    # a plant off by 0.2 / peak, in the worst phase, has the critical point on its loop gain
    gain = loop_gain_by_hand([test.frequency])[0, 0, 0]
    turned = -(1 + gain) / gain
    assert abs(turned) == pytest.approx(0.2 / test.peak, rel=1e-6)
    assert abs(1 + gain * (1 + turned)) < 1e-9


@pytest.mark.parametrize("weight", [HELD_OUT, FLOOR_WEIGHT])
def test_a_crossover_outside_the_band_of_the_weight_claims_no_robust_stability(
    folder, model, weight
):
    budget = error_budget(model, model.drawn, loop_definition(folder, model))
    fine = np.linspace(1.0, 200.0, 100_000)
    gain = np.abs(loop_gain_by_hand(fine)[:, 0, 0])
    crossovers = fine[:-1][np.diff(np.sign(gain - 1)) != 0]
    for share, known in ((0.8, None), (1.5, True)):
        lines = np.linspace(0.5, share * crossovers[-1], len(LINES))
        result = replace(tuning_with(np.full(len(LINES), 1e-3), has_own=True), freq_hz=lines)
        posterior = spring_posterior(model, 0.0, 1e-4)
        margins = margins_of(budget, tuning=result, posterior=posterior)
        tests = {test.weight: test for test in margins.robust[0]}
        assert tests[weight].peak < 1
        assert tests[weight].band == (lines[0], lines[-1])
        assert tests[weight].robustly_stable is known
        outside = [each for each in crossovers if each > lines[-1]]
        for each in outside:
            assert np.abs(np.array(tests[weight].outside) / each - 1).min() < 1e-3
        sentence = next(
            robust_sentence(row)
            for row in margins_row(margins).loops[0].robust
            if (row.weight, row.robustly_stable) == (weight, known)
        )
        assert sentence.startswith("robustly stable" if known else "not known to be stable")
        if not known:
            assert f"{tests[weight].outside[-1]:.4g} Hz: test from" in sentence
            assert tests[weight].wanted_band[1] >= 2 * outside[-1] * 0.999
            assert len(margins.robust_at_once[0].outside) == len(tests[weight].outside)


def test_the_own_plant_of_a_loop_counts_before_the_error_at_the_inputs(folder, model):
    (loop,) = loop_definition(folder, model).loops
    error = 0.1 * np.exp(1j * LINES)
    loop_error = held_out_loop_error(tuning_with(error, has_own=True), loop)
    np.testing.assert_allclose(loop_error.errors, 0.1 * np.ones((1, len(LINES))), rtol=1e-9)
    input_error = held_out_loop_error(tuning_with(error, has_own=False), loop)
    np.testing.assert_allclose(input_error.errors, 0.1 * np.ones((1, len(LINES))), rtol=1e-6)
    # inputs of different units have no common error
    mixed = tuning_with(error, has_own=False, inputs=("acc1:+tx", "acc1:+rz"))
    assert held_out_loop_error(mixed, loop) is None
    budget = error_budget(model, model.drawn, loop_definition(folder, model))
    assert margins_of(budget, tuning=mixed).robust == ((),)


def test_the_floor_of_two_loops_is_that_of_machines_that_are_changed_at_random(folder, model):
    # dZ = e sqrt(a_r a_s) X_rs between the undamped modes, X complex normal, X_rr = 0.
    error, count, rng = 1e-4, 4000, np.random.default_rng(8)
    definition = loop_definition(folder, model, SECOND_LOOP)
    fitted = FittedMachine(model, spring_posterior(model, 0.0, error))
    margins = plant_budget(fitted, definition).margins
    m1, k1, c1, m2, k2, c2 = VALUES.values()
    mass, stiffness = np.diag([m1, m2]), np.array([[k1 + k2, -k2], [-k2, k2]])
    damping = np.array([[c1 + c2, -c2], [-c2, c2]])
    squares, shapes = eigh(stiffness, mass)
    for number, (test,) in enumerate(margins.robust):
        assert test.weight == FLOOR_WEIGHT
        s = 2j * np.pi * test.frequency
        dynamic = s**2 * mass + s * damping + stiffness
        root = np.sqrt(squares + abs(s) ** 2)
        drawn = rng.standard_normal((2, count, 2, 2)) / np.sqrt(2)
        coupling = (drawn[0] + 1j * drawn[1]) * (1 - np.eye(2)) * np.outer(root, root)
        changed = dynamic + error * (mass @ shapes @ coupling @ shapes.T @ mass)
        forces = np.array([[-2.0, 1.0], [2.0, 0.0]])
        reading = np.array([[-1.0, 1.0], [s, 0.0]])
        controllers = np.array(
            [
                3e5 * (s + 60) * (s + 8) / ((s + 0.5) * (s + 700)) * np.exp(-s * LOOP_DELAY),
                4e5 / (s + 400),
            ]
        )

        def single(matrices, forces=forces, reading=reading, k=controllers, number=number):
            gains = reading @ np.linalg.solve(matrices, forces.astype(complex)) * k
            return 1 / np.linalg.inv(np.eye(2) + gains)[..., number, number] - 1

        nominal = single(dynamic)
        moved = np.abs(single(changed) - nominal) / abs(1 + nominal)
        assert np.quantile(moved, 0.95) == pytest.approx(test.peak, rel=0.05)
    together = margins.robust_at_once[0].peak
    assert together >= max(test.peak for (test,) in margins.robust) * 0.99
