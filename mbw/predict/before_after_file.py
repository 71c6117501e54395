"""JSON of a machine before and after something is put on it."""

import numpy as np

from identification.words import Complex, Real
from mbmodel import COMBINED_NAME
from mbw.predict.before_after import BeforeAfter, frequency_change
from mbw.predict.curves import Curves
from mbw.predict.mode_rows import pole_fields
from mbw.predict.schema import (
    AddedMassRow,
    BeforeAfterRow,
    FrfPeakRow,
    ModeRow,
    PutOnTopRow,
)
from mbw.prediction import Prediction


def put_on_top_row(comparison: BeforeAfter, curves: Curves) -> PutOnTopRow:
    """Return what was put on the machine, with modes and FRFs before and after.

    Args:
        comparison: modes before and after.
        curves: FRFs before and after.
    """
    additions, stage = comparison.additions, comparison.additions.stage
    place = "" if stage is None else stage.place
    spot = place if isinstance(place, str) else ",".join(f"{value:g}" for value in place)
    return PutOnTopRow(
        combined=COMBINED_NAME,
        stage=None if stage is None else str(stage.path),
        at=None if stage is None else f"{stage.body}:{spot}",
        prefix=comparison.prefix,
        added_masses=[
            AddedMassRow(body=mass.body, mass=mass.mass_kg, offset=list(mass.offset_m))
            for mass in additions.masses
        ],
        before=[
            ModeRow(**pole_fields(comparison.before, number))
            for number in range(len(comparison.before.modes.poles))
        ],
        pairs=[_pair(comparison, *pair) for pair in comparison.pairs],
        new=comparison.new,
        gone=comparison.gone,
        frfs=_peaks(curves),
    )


def _damping(prediction: Prediction, number: int) -> float | None:
    """Return the damping ratio of a mode; None for a mode at rest."""
    is_at_rest = prediction.is_at_rest(number)
    return None if is_at_rest else float(prediction.modes.damping[number])


def _pair(comparison: BeforeAfter, before: int, after: int) -> BeforeAfterRow:
    return BeforeAfterRow(
        before=before,
        after=after,
        mac=float(comparison.criterion[before, after]),
        frequency_change=frequency_change(comparison, before, after),
        damping_before=_damping(comparison.before, before),
        damping_after=_damping(comparison.after, after),
    )


def _peaks(curves: Curves) -> list[FrfPeakRow]:
    """Return the largest magnitude of each FRF, before and after."""
    rows = []
    for number, label in enumerate(curves.labels):
        (before, before_hz), (after, after_hz) = (
            _largest_magnitude(curves.freq_hz, values[number])
            for values in (curves.before, curves.values)
        )
        rows.append(
            FrfPeakRow(
                label=label,
                unit=curves.units[number],
                peak_before=before,
                peak_before_hz=before_hz,
                peak_after=after,
                peak_after_hz=after_hz,
            )
        )
    return rows


def _largest_magnitude(freq_hz: Real, values: Complex) -> tuple[float | None, float | None]:
    """Return the largest magnitude of an FRF and its frequency; None for an FRF of nan."""
    size = np.abs(values)
    if not np.isfinite(size).all():
        return None, None
    largest = int(size.argmax())
    return float(size[largest]), float(freq_hz[largest])
