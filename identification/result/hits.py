"""Hits of raw time records, as rows of ``modes.json`` and arrays of ``modes.npz``."""

from typing import Any

import numpy as np

from identification.result.schema import HitsRow, IdentifiedModeRow, KeptHit, RejectedHit
from identification.words import (
    Campaign,
    HitEstimate,
    Real,
    SignalTraces,
    SpectralDensities,
    Test,
)

_MAX_DENSITY_LINES = 1000  # frequency lines of a spectral density; beyond, neighbours are averaged


def hits_rows(campaign: Campaign, modes: list[IdentifiedModeRow]) -> list[HitsRow]:
    """Return one row for each test that was made from time records.

    Args:
        modes: identified modes, to state what an exponential window adds to their damping.
    """
    return [_row(test, test.hits, modes) for test in campaign.tests if test.hits is not None]


def _row(test: Test, hits: HitEstimate, modes: list[IdentifiedModeRow]) -> HitsRow:
    tau = hits.estimate.window_tau
    return HitsRow(
        test=hits.test,
        setup=test.condition.setup,
        reference=str(hits.reference),
        unit=test.condition.drive_unit,
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
        left=hits.residual_response,
        estimator=hits.estimator,
    )


def hits_arrays(campaign: Campaign) -> dict[str, Any]:
    """Return the spectral densities of each test from time records by name, in single precision.

    ``hits_1_force`` [N/sqrt(Hz)] (n_line,) and ``hits_1_motion`` [unit of the records/sqrt(Hz)]
    (n_line, n_out) stand on the frequency lines ``hits_1_freq_hz``. Names with ``hits_1_noise_``
    are those of the signals before the hits, if any. ``hits_1_record_force`` [N] (n_point,) and
    ``hits_1_record_motion`` (n_point, n_out) are the signals of one record at
    ``hits_1_record_time_s``, those with ``hits_1_block_`` of its first averaged
    hit. The number is the row of ``modes.json``, from 1.
    """
    arrays: dict[str, Any] = {}
    estimates = (test.hits for test in campaign.tests if test.hits is not None)
    for number, hits in enumerate(estimates, start=1):
        arrays |= _density_arrays(f"hits_{number}_", hits.densities, hits.usable_limit_hz)
        for name, traces in (("record", hits.whole_record), ("block", hits.first_block)):
            arrays |= _trace_arrays(f"hits_{number}_{name}_", traces)
        if hits.noise is not None:
            arrays |= _density_arrays(f"hits_{number}_noise_", hits.noise, hits.usable_limit_hz)
    return arrays


def _trace_arrays(prefix: str, traces: SignalTraces) -> dict[str, Any]:
    return {
        f"{prefix}number": traces.record,
        f"{prefix}time_s": traces.time_s,
        f"{prefix}force": traces.force.astype(np.float32),
        f"{prefix}motion": traces.motion.astype(np.float32),
    }


def _density_arrays(prefix: str, densities: SpectralDensities, highest_hz: float) -> dict[str, Any]:
    """Return densities above 0 Hz up to the limit of the anti-aliasing filters.

    There are at most a thousand frequency lines.
    """
    shown = (densities.freq_hz > 0) & (densities.freq_hz <= highest_hz)
    width = -(-int(shown.sum()) // _MAX_DENSITY_LINES)
    force = np.sqrt(_average_neighbours(densities.force[shown] ** 2, width))
    motion = np.sqrt(_average_neighbours(densities.motion[shown] ** 2, width))
    return {
        f"{prefix}freq_hz": _average_neighbours(densities.freq_hz[shown], width),
        f"{prefix}force": force.astype(np.float32),
        f"{prefix}motion": motion.astype(np.float32),
    }


def _average_neighbours(values: Real, width: int) -> Real:
    """Return means over ``width`` neighbouring lines, the last over fewer; (n_line, ...)."""
    if width < 2:
        return values
    starts = np.arange(0, len(values), width)
    counts = np.diff(np.append(starts, len(values)))
    sums = np.add.reduceat(values, starts, axis=0)
    return np.asarray(sums / counts.reshape(-1, *[1] * (values.ndim - 1)), np.float64)
