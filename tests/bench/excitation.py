"""FRFs of forces that never rest: how often the exact FRF lies in the region that is stated.

One to three forces at once, 100 tests of each kind, 5 % of noise. The 95 % region of n independent
blocks and q forces is |error|^2 <= variance F(0.95; 2, 2 (n - q)). The interval is that of the mean
over tests, whose lines share their noise. Seeds 730000 and up.
"""

from collections.abc import Iterator

import numpy as np
import scipy.signal
import scipy.stats

from identification.continuous import estimate_continuous_frf
from identification.words import Real
from tests.helpers.shaken_machine import RATE_HZ, multisine, ratio, shake

FIRST, TESTS = 730_000, 100
KINDS = ("random", "burst", "multisine", "sweep")
NOISE = 0.05
_SAMPLES = 20_000


def run() -> list[dict[str, object]]:
    """Return the coverage of each kind of force and number of forces."""
    return [_coverage(kind, inputs) for kind in KINDS for inputs in (1, 2, 3)]


def _coverage(kind: str, inputs: int) -> dict[str, object]:
    inside, averages = [], 0
    for number, force in enumerate(_forces(kind, inputs)):
        records = shake(force, tuple(range(inputs)), NOISE, FIRST + number)
        result = estimate_continuous_frf(records)
        averages = result.estimate.averages or 0
        bound = scipy.stats.f.ppf(0.95, 2, 2 * (averages - inputs))
        inside.append(float((ratio(records, result) <= bound).mean()))
    half = 1.96 * np.std(inside, ddof=1) / np.sqrt(len(inside))
    mean = float(np.mean(inside))
    return {
        "force": kind,
        "inputs": inputs,
        "tests": len(inside),
        "independent blocks": averages,
        "inside %": 100 * mean,
        "from": 100 * (mean - half),
        "to": 100 * (mean + half),
    }


def _forces(kind: str, inputs: int) -> Iterator[Real]:
    """Yield forces of all tests; (n_in, n_record, n_sample)."""
    for number in range(TESTS):
        random = np.random.default_rng(FIRST + number)
        if kind == "multisine":
            yield multisine(inputs, inputs + 1, 6, seed=FIRST + number)
        elif kind == "burst":
            time = np.arange(8192) / RATE_HZ
            burst = random.standard_normal((inputs, 12 + 4 * inputs, 8192))
            yield burst * ((time > 10) & (time < 14))
        elif kind == "sweep":
            time = np.arange(inputs * _SAMPLES) / RATE_HZ
            ends = random.uniform(60, 68, inputs), random.uniform(2, 4, inputs)
            phases = random.uniform(0, 360, inputs)
            yield np.array(
                [
                    scipy.signal.chirp(time, low, time[-1] / 4 * (k + 1), high, phi=phase)
                    for k, (high, low, phase) in enumerate(zip(*ends, phases, strict=True))
                ]
            )[:, None]
        else:
            yield random.standard_normal((inputs, 1, inputs * _SAMPLES))
