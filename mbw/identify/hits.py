"""Hits of raw time records in the files and on the page of ``mbw identify``."""

from typing import Any

import numpy as np

from identification.words import Campaign, Densities, HitEstimate, Real, Test
from mbw.identify.schema import HitsRow, KeptHit, ModeRow, RejectedHit
from mbw.page.html import packed, text_of

_LINES = 1000  # of a density, at most: neighbours share one beyond it


def hits_rows(campaign: Campaign, modes: list[ModeRow]) -> list[HitsRow]:
    """One row for each test of time records.

    Args:
        campaign: its tests.
        modes: to say what an exponential window adds to their damping.
    """
    return [_row(test, test.hits, modes) for test in campaign.tests if test.hits is not None]


def _row(test: Test, hits: HitEstimate, modes: list[ModeRow]) -> HitsRow:
    tau = hits.estimate.window_tau
    return HitsRow(
        test=hits.test,
        setup=test.condition.setup,
        reference=str(hits.reference),
        outputs=[str(dof) for dof in hits.estimate.frf.outputs],
        kept=[
            KeptHit(record=hit.record, hit=hit.number, time=hit.time_s, peak=hit.peak_n)
            for hit in hits.kept
        ],
        rejected=[
            RejectedHit(record=hit.record, hit=hit.hit, time=hit.time_s, reason=hit.reason)
            for hit in hits.rejected
        ],
        rate=hits.rate_hz,
        block=hits.block_s,
        pretrigger=hits.pretrigger_s,
        force_window=hits.force_window_s,
        exponential_tau=tau,
        added_damping=[1 / (tau * 2 * np.pi * mode.frequency) if tau else 0.0 for mode in modes],
        left=hits.left,
        estimator=hits.estimator,
    )


def hits_arrays(campaign: Campaign) -> dict[str, Any]:
    """Densities of each test of time records by name, in single precision.

    ``hits_1_force`` [N/sqrt(Hz)] (n_line,) and ``hits_1_motion`` [unit of the records/sqrt(Hz)]
    (n_line, n_out) on the lines ``hits_1_freq_hz``; with ``hits_1_noise_`` those before the hits,
    where there are any. The number is that of the row in ``modes.json``, from 1.
    """
    found: dict[str, Any] = {}
    every = (test.hits for test in campaign.tests if test.hits is not None)
    for number, hits in enumerate(every, start=1):
        found |= _named(f"hits_{number}_", hits.densities, hits.highest_hz)
        if hits.noise is not None:
            found |= _named(f"hits_{number}_noise_", hits.noise, hits.highest_hz)
    return found


def _named(prefix: str, of: Densities, highest_hz: float) -> dict[str, Any]:
    """Up to where anti-aliasing filters reach, without 0 Hz; at most a thousand lines."""
    shown = (of.freq_hz > 0) & (of.freq_hz <= highest_hz)
    width = -(-int(shown.sum()) // _LINES)
    return {
        f"{prefix}freq_hz": _grouped(of.freq_hz[shown], width),
        f"{prefix}force": np.sqrt(_grouped(of.force[shown] ** 2, width)).astype(np.float32),
        f"{prefix}motion": np.sqrt(_grouped(of.motion[shown] ** 2, width)).astype(np.float32),
    }


def _grouped(values: Real, width: int) -> Real:
    """Means over so many neighbouring lines, the last over fewer; (n_line, ...)."""
    if width < 2:
        return values
    starts = np.arange(0, len(values), width)
    counts = np.diff(np.append(starts, len(values)))
    sums = np.add.reduceat(values, starts, axis=0)
    return np.asarray(sums / counts.reshape(-1, *[1] * (values.ndim - 1)), np.float64)


def hits_section(rows: list[HitsRow]) -> str:
    """HTML of the section; none without rows."""
    return text_of("identify/hits.html") if rows else ""


def hits_data(rows: list[HitsRow], arrays: dict[str, Any]) -> list[dict[str, object]]:
    """What the page's script shows of each reference.

    Args:
        rows: of modes.json.
        arrays: of modes.npz.
    """
    return [
        {
            **row.model_dump(exclude={"kept", "added_damping"}),
            "kept": len(row.kept),
            "peaks": sorted((hit.peak for hit in row.kept), key=abs),
            "added": max(row.added_damping, default=0.0),
            "densities": _packed(arrays, f"hits_{number}_"),
            "noise": _packed(arrays, f"hits_{number}_noise_"),
        }
        for number, row in enumerate(rows, start=1)
    ]


def _packed(arrays: dict[str, Any], prefix: str) -> dict[str, str] | None:
    if f"{prefix}force" not in arrays:
        return None
    return {
        "freq": packed(arrays[f"{prefix}freq_hz"]),
        "force": packed(arrays[f"{prefix}force"]),
        "motion": packed(arrays[f"{prefix}motion"].T),
    }
