"""Virtual hammer test of the station: time, error against the linear model, stated variance."""

import os
import time
from pathlib import Path

import numpy as np

from identification.hits.hit_frfs import estimate_hit_frfs
from identification.hits.settings import HitSettings
from identification.words import Dof
from mbmodel import (
    Evaluator,
    FrfRequest,
    HammerTestPlan,
    HitScatter,
    Machine,
    Noise,
    RecordedFile,
    as_drawn,
    load_machine,
    strike,
)

STATION = Path(__file__).resolve().parents[2] / "assets" / "microstation" / "station.xml"
RATE_HZ, BLOCK_S, HITS, LEVEL_N = 512.0, 4.0, 10, 200.0
BAND_HZ = (4.0, 199.0)
SEED = 7
STEADY_AIM = HitScatter(angle=0.0, place=0.0)
# Loud, so that the noise and not the step of the integration decides the variance.
NOISES = {"no noise": Noise(0.0, 0.0), "noise": Noise(1e-3, 5e-3)}


def run() -> list[dict[str, object]]:
    """Three directions of ten hits of 4 s on 69 channels, without noise and with it."""
    machine = load_machine(STATION)
    outputs = tuple(Dof.of(f"acc{k}", axis) for k in range(1, 24) for axis in range(3))
    references = tuple(Dof.of("acc11", axis) for axis in range(3))
    file = RecordedFile("hits.npz", LEVEL_N, outputs, references, HITS)
    rows: list[dict[str, object]] = []
    for name, noise in NOISES.items():
        plan = HammerTestPlan((file,), RATE_HZ, BLOCK_S, scatter=STEADY_AIM, noise=noise)
        wall, cpu = time.perf_counter(), time.process_time()
        test = strike(machine, plan, seed=SEED, threads=os.cpu_count() or 1)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        records = test.records[file.file]
        error, chi_square = _compare(machine, records)
        rows.append(
            {
                "test": name,
                "hits": HITS * len(references),
                "wall s": wall,
                "CPU s": cpu,
                "largest error of a channel": "" if noise.motion else error,
                "estimated error": test.step.error,
                "chi-square": "" if noise.motion == 0 else chi_square,
            }
        )
    return rows


def _compare(machine: Machine, records: tuple[object, ...]) -> tuple[float, float]:
    """Return the largest relative error of a channel, and squared errors over their variance."""
    model = as_drawn(machine)
    errors, ratios = [], []
    for hits in estimate_hit_frfs(records, [HitSettings()] * len(records)):
        frf, tau = hits.estimate.frf, hits.estimate.window_tau
        lines = (frf.freq_hz > BAND_HZ[0]) & (frf.freq_hz < BAND_HZ[1])
        request = FrfRequest(frf.freq_hz[lines], frf.outputs, frf.inputs, window_tau=tau)
        linear = Evaluator(model, request).at(model.drawn).values
        off = (np.abs(frf.values[lines] - linear) ** 2).sum(axis=0)
        errors.append(np.sqrt(off / (np.abs(linear) ** 2).sum(axis=0)).max())
        ratios.append((off / hits.estimate.variance[lines].sum(axis=0)).mean())
    return float(np.max(errors)), float(np.mean(ratios))
