"""Modes found without a click on synthetic machines, beside sdypy-EMA and pyFBS on the same data.

Seeds 7001 and up are reported only: whatever was chosen in the method was chosen on others.
"""

import time

import numpy as np
from sdypy import EMA

from identification.modal import WeightedFrfs, identify_modes, lscf
from tests.bench.peer_pyfbs import pyfbs_poles
from tests.helpers.modal_case import found_and_extra, modal_case

CASES = ((24, 0.037), (23, 0.037), (25, 0.037), (35, 0.059), (36, 0.059))
SEEDS = (7001, 7002, 7003)


def run() -> list[dict[str, object]]:
    """69 x 3 x 801, 0 to 200 Hz, 1 % noise: 24 to 25 modes, and the dense 35 and 36.

    Modes differ by their spread of 0.5: with all alike sdypy-EMA finds up to 25 of 25, which
    would be too easy.
    """
    return [_row(seed, count, highest) for seed in SEEDS for count, highest in CASES]


def _row(seed: int, count: int, highest: float) -> dict[str, object]:
    case = modal_case(1000 * count + seed, count, highest_damping=highest, spread=0.5)
    size = np.sqrt((np.abs(case.noisy) ** 2).mean(axis=(0, 2)))
    poles_s, _ = _timed(lambda: lscf(case.freq_hz, case.noisy / size[:, None], 40))
    s = 2j * np.pi * case.freq_hz
    data = WeightedFrfs(s, 2, case.noisy, np.ones((len(s), 1, 1)), 1 / case.sd**2)
    all_s, found = _timed(lambda: identify_modes(data, case.freq_hz))
    fit = found.fit
    hits, extra = found_and_extra(case, fit.freq_hz[found.inside], fit.damping[found.inside])
    error = np.sqrt((np.abs(fit.values(s, 2) - case.clean) ** 2).mean(axis=0))
    peer = EMA.Model(
        frf=case.noisy.reshape(len(s), -1).T,
        freq=case.freq_hz,
        lower=5,
        upper=200,
        pol_order_high=60,
    )
    peer_s, _ = _timed(lambda: peer.get_poles(show_progress=False))
    return {
        "seed": seed,
        "modes": count,
        "found": hits,
        "extra": extra,
        "error %": 100 * float(np.sqrt(((error / (100 * case.sd)) ** 2).mean())),
        "misfit": found.misfit,
        "all s": all_s,
        "poles s": poles_s,
        "sdypy poles / ours": peer_s / poles_s,
        "sdypy best order": max(_peer_found(case, poles) for poles in peer.all_poles),
        **_pyfbs(case, poles_s),
    }


def _pyfbs(case, ours_s: float) -> dict[str, object]:  # type: ignore[no-untyped-def]
    """pyFBS to as many roots, every second order, as it does by default."""
    seconds, orders = _timed(lambda: pyfbs_poles(case.freq_hz, case.noisy, 42))
    if orders is None:
        return {"pyFBS poles / ours": None, "pyFBS best order": None}
    return {
        "pyFBS poles / ours": seconds / ours_s,
        "pyFBS best order": max(_peer_found(case, poles) for poles in orders),
    }


def _peer_found(case, poles) -> int:  # type: ignore[no-untyped-def]
    poles = np.array(poles)
    freq, damping = np.abs(poles) / 2 / np.pi, -poles.real / np.abs(poles)
    stable = (poles.imag > 0) & (damping > 0) & (damping < 0.2) & (freq < 200)
    return found_and_extra(case, freq[stable], damping[stable])[0]


def _timed(function):  # type: ignore[no-untyped-def]
    start = time.perf_counter()
    result = function()
    return time.perf_counter() - start, result
