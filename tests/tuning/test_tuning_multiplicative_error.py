"""The error at the inputs: an error that was put in comes out, and the noise does not."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from identification.words import InputError
from tuning import LevelFrfs, TuningResult
from tuning.plant.uncertainty.multiplicative_error import held_out_input_error

FREQ = np.linspace(0.0, 100.0, 201)
OUTPUTS = tuple(f"acc{node}:+t{axis}" for node in range(1, 9) for axis in "xyz")
FILES = ("soft.uff", "hard.uff")


def result_of(error, noise=0.0, *, held_out=True, seed=1):
    """Two files of two references; the second one lacks a channel. error: of each file, or one."""
    random = np.random.default_rng(seed)

    def normal(*shape):
        return random.normal(size=shape) + 1j * random.normal(size=shape)

    columns = {key: [] for key in ("outputs", "tests", "measured", "predicted", "noise")}
    for number, file in enumerate(FILES):
        model = normal(len(FREQ), len(OUTPUTS), 2)
        measured = model @ (np.eye(2) + np.broadcast_to(error, (2, len(FREQ), 2, 2))[number])
        sigma = noise * random.uniform(0.5, 2.0, model.shape)
        measured = measured + sigma * normal(*model.shape) / np.sqrt(2)
        for k, reference in enumerate(("acc1:+tx", "acc1:-ty")):
            for row, output in enumerate(OUTPUTS[: len(OUTPUTS) - (number and k)]):
                columns["outputs"].append(output)
                columns["tests"].append(f"{reference} in {file}")
                columns["measured"].append(measured[:, row, k])
                columns["predicted"].append(model[:, row, k])
                columns["noise"].append(sigma[:, row, k])
    table = {key: np.array(columns[key]).T for key in ("measured", "predicted", "noise")}
    frfs = LevelFrfs(
        tuple(columns["outputs"]),
        tuple(columns["tests"]),
        table["measured"],
        table["predicted"],
        table["predicted"],
        table["noise"],
        held_out=table["predicted"] if held_out else None,
    )
    summary = SimpleNamespace(held_out_blocks=[None] * 20)
    return TuningResult(summary, FREQ, {"sensors": frfs})


def test_the_largest_singular_value_of_the_error_comes_out():
    random = np.random.default_rng(4)
    error = 0.1 * (random.normal(size=(2, 201, 2, 2)) + 1j * random.normal(size=(2, 201, 2, 2)))
    shown = held_out_input_error(result_of(error))
    sizes = np.linalg.norm(error, ord=2, axis=(2, 3))[:, 1:]
    assert len(shown.freq_hz) == 200
    np.testing.assert_allclose(shown.errors, sizes, rtol=1e-6)
    window = np.quantile(sizes[:, 95:105], 0.95)
    assert shown.quantile[100] == pytest.approx(window, rel=1e-6)


def test_noise_is_taken_off():
    result = result_of(0.0, noise=0.05)
    silent = replace(result.levels["sensors"], noise=0 * result.levels["sensors"].noise)
    raw = held_out_input_error(replace(result, levels={"sensors": silent})).errors
    nothing = held_out_input_error(result).errors
    assert np.median(raw**2 - nothing**2) > 0.4 * np.median(raw**2)
    error = 0.03 * np.array([[1.0, 0.4], [0.2, -0.7]])
    size = np.linalg.norm(error, ord=2)
    shown = held_out_input_error(result_of(error, noise=0.05)).errors
    assert np.median(shown) == pytest.approx(size, rel=0.1)


def test_without_held_out_lines_nothing_is_known():
    with pytest.raises(InputError, match="held-out"):
        held_out_input_error(result_of(0.1, held_out=False))
