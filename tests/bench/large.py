"""FRFs and gradient of 60 bodies, 720 parameters: speed against differences, memory."""

import resource
import sys
import tempfile
import time
from pathlib import Path
from unittest import mock

import numpy as np

from identification.words import Dof
from mbmodel import Evaluator, FrfRequest, Model, as_drawn, load_machine, state_space
from tests.helpers.large_machine import large_mjcf

REPEATS = 7


def run() -> list[dict[str, object]]:
    """60 bodies on six joints each, 200 outputs x 3 inputs x 801 lines."""
    model = _machine(60)
    points = model.machine.layout.points
    outputs = tuple(Dof.of(point, axis) for point in points for axis in range(3))[:200]
    inputs = tuple(Dof.of(points[-1], axis) for axis in range(3))
    question = FrfRequest(np.linspace(0, 200, 801), outputs, inputs)
    evaluator = Evaluator(model, question)
    random = np.random.default_rng(0)
    theta = model.drawn * np.exp(0.1 * random.normal(size=len(model.drawn)))
    parts = random.normal(size=(2, 801, len(outputs), 3))
    cotangent = parts[0] + 1j * parts[1]
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        lines = evaluator.at(theta)
        values = lines.values
        lines.gradient(cotangent)
        times.append(time.perf_counter() - start)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    ours = float(np.median(times))
    system = state_space(model, theta, question)
    omega = 2 * np.pi * question.freq_hz
    slycot, _ = _timed(lambda: system.frequency_response(omega))
    with mock.patch.dict(sys.modules, {"slycot": None}):
        plain, peer = _timed(lambda: system.frequency_response(omega).frdata.transpose(2, 0, 1))
    error = float((np.abs(values - peer) / np.abs(peer).max(axis=0)).max())
    count = len(model.drawn) + 1
    rows: list[tuple[str, float, object, object]] = [
        ("FRFs and gradient, ours", ours, f"{memory / 2**20:.2f} GiB", error),
        (f"{count} evaluations of python-control", count * plain, "", ""),
        (f"{count} evaluations of python-control with slycot", count * slycot, "", ""),
    ]
    return [
        {"work": work, "s": seconds, "times ours": seconds / ours, "peak memory": used, "error": e}
        for work, seconds, used, e in rows
    ]


def _machine(n_body: int) -> Model:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "large.xml"
        path.write_text(large_mjcf(n_body), encoding="utf-8")
        return as_drawn(load_machine(path))


def _timed(function):  # type: ignore[no-untyped-def]
    start = time.perf_counter()
    result = function()
    return time.perf_counter() - start, result
