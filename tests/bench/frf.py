"""FRFs and their gradient: speed against python-control, error against 40 digits."""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from unittest import mock

import mpmath
import numpy as np

from identification.words import Dof
from mbmodel import Evaluator, FrfRequest, as_drawn, load_machine, state_space

STATION = Path(__file__).resolve().parents[2] / "assets" / "microstation" / "station.xml"
REPEATS = 31
DIGITS = 40


def run() -> list[dict[str, object]]:
    """69 outputs x 3 inputs x 801 lines on the station, 72 parameters."""
    model = as_drawn(load_machine(STATION))
    outputs = tuple(Dof.of(f"acc{k}", axis) for k in range(1, 24) for axis in range(3))
    inputs = tuple(Dof.of("acc11", axis) for axis in range(3))
    question = FrfRequest(np.linspace(0, 200, 801), outputs, inputs)
    evaluator = Evaluator(model, question)
    system = state_space(model, model.drawn, question)
    omega = 2 * np.pi * question.freq_hz
    cotangent = np.random.default_rng(0).normal(size=(2, 801, 69, 3))
    cotangent = cotangent[0] + 1j * cotangent[1]

    def ours() -> object:
        return evaluator.at(model.drawn).values

    def with_gradient() -> object:
        linearised = evaluator.at(model.drawn)
        return linearised.values, linearised.gradient(cotangent)

    def slycot() -> object:
        return system.frequency_response(omega)

    def plain() -> object:
        with mock.patch.dict(sys.modules, {"slycot": None}):
            return system.frequency_response(omega)

    times = _alternate(ours, with_gradient, slycot, plain)
    error = _worst_error(model, question, evaluator.at(model.drawn).values)
    with mock.patch.dict(sys.modules, {"slycot": None}):
        peer = system.frequency_response(omega).frdata.transpose(2, 0, 1)
    peer_error = _worst_error(model, question, peer)
    count = len(model.drawn) + 1
    return [
        _row("FRFs, ours", times[0], times[0], error),
        _row("FRFs, python-control", times[3], times[0], peer_error),
        _row("FRFs, python-control with slycot", times[2], times[0], None),
        _row("FRFs and gradient, ours", times[1], times[1], None),
        _row(
            f"the same by {count} evaluations of python-control with slycot",
            count * times[2],
            times[1],
            None,
        ),
    ]


def _row(work: str, seconds: float, ours: float, error: float | None) -> dict[str, object]:
    return {
        "work": work,
        "ms": 1e3 * seconds,
        "times ours": seconds / ours,
        "worst error": "" if error is None else error,
    }


def _alternate(*functions: Callable[[], object]) -> list[float]:
    """Median processor time of each, called in turn: other processes do not count."""
    for function in functions:
        function()
    times: list[list[float]] = [[] for _ in functions]
    for _ in range(REPEATS):
        for function, record in zip(functions, times, strict=True):
            start = time.process_time()
            function()
            record.append(time.process_time() - start)
    return [float(np.median(record)) for record in times]


def _worst_error(model, question: FrfRequest, values: np.ndarray) -> float:  # type: ignore[no-untyped-def]
    """Largest error on 13 lines, relative to the largest value of each channel."""
    matrices = model.matrices(model.drawn)
    layout, jacobian = model.machine.layout, model.machine.jacobian
    readout = layout.rows(question.outputs) @ jacobian
    drive = (layout.rows(question.inputs) @ jacobian).T
    peak = np.abs(values).max(axis=0)
    worst = 0.0
    with mpmath.workdps(DIGITS):
        for line in range(1, 801, 65):
            s = mpmath.mpc(0, 2 * mpmath.pi * mpmath.mpf(float(question.freq_hz[line])))
            dynamic = (
                mpmath.matrix(matrices.mass.tolist()) * s**2
                + mpmath.matrix(matrices.damping.tolist()) * s
                + mpmath.matrix(matrices.stiffness.tolist())
            )
            for column in range(drive.shape[1]):
                motion = mpmath.lu_solve(dynamic, mpmath.matrix(drive[:, column].tolist()))
                exact = mpmath.matrix(readout.tolist()) * motion * s**2
                exact = np.array([complex(value) for value in exact])
                error = np.abs(values[line, :, column] - exact) / peak[:, column]
                worst = max(worst, float(error.max()))
    return worst
