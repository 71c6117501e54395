"""Do the 95 % intervals of identified modes hold? Coverage over repetitions of whole runs.

Seeds 20000 and up are reported only.
"""

import numpy as np

from identification.modal import WeightedFrfs, identify_modes
from tests.helpers.modal_case import modal_case

REPETITIONS = 200
FIRST = 20_000


def run() -> list[dict[str, object]]:
    """8 modes of 12, 18 x 3 x 401, 1 % noise: another machine and another noise each time."""
    hits: dict[str, list[np.ndarray]] = {"frequency": [], "damping": []}
    for seed in range(FIRST, FIRST + REPETITIONS):
        case = modal_case(seed, 8, total=12, n_out=18, lines=401, start=10)
        s = 2j * np.pi * case.freq_hz
        data = WeightedFrfs(s, 2, case.noisy, np.ones((len(s), 1, 1)), 1 / case.sd**2)
        found = identify_modes(data, case.freq_hz)
        fit = found.fit
        nearest = np.abs(fit.freq_hz[:, None] / case.modes_hz - 1).argmin(axis=0)
        for name, off, sd in (
            ("frequency", fit.freq_hz[nearest] - case.modes_hz, found.freq_sd[nearest]),
            ("damping", fit.damping[nearest] - case.damping, found.damping_sd[nearest]),
        ):
            hits[name].append(np.abs(off) <= 1.96 * sd)
    return [_row(name, np.array(inside)) for name, inside in hits.items()]


def _row(name: str, inside: np.ndarray) -> dict[str, object]:
    """Pooled coverage with an interval that counts whole repetitions, not modes."""
    each = inside.mean(axis=1)
    half = 1.96 * each.std(ddof=1) / np.sqrt(len(each))
    return {
        "of": name,
        "n": int(inside.size),
        "coverage %": 100 * float(each.mean()),
        "from": 100 * float(each.mean() - half),
        "to": 100 * float(each.mean() + half),
    }
