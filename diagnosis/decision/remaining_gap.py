"""Rest: the gap that remains with the present causes, and where it may act."""

from collections.abc import Sequence
from typing import Literal

from diagnosis.estimates.held_out_gap import GapEstimates
from diagnosis.inference.evidence import Evidence
from diagnosis.inference.places import compute_force_shares
from diagnosis.refits.refit import Refit
from diagnosis.settings import DiagnosisSettings
from identification.readers.result_files import StrictRow
from tuning import is_gap_visible

Spread = Literal["local", "everywhere"]


class Where(StrictRow):
    """Place of a cause, with its probability over all places; null where nothing is missing."""

    location: str
    share: float | None


class RestRow(StrictRow):
    """Rest: the gap that remains with the present causes.

    Args:
        excess: over the noise, on held-out lines.
        model_error: relative error of the model at the sensors' points.
        significant: whether it is more than next to nothing.
        spread: ``local`` if a force at one place would explain much of it.
        where: places by their share.
    """

    excess: float | None
    model_error: float
    significant: bool
    spread: Spread
    where: list[Where]


def describe_rest(
    evidence: Evidence,
    refit: Refit,
    gaps: GapEstimates,
    settings: DiagnosisSettings,
    *,
    is_none: bool,
) -> RestRow:
    """Return the rest, which is not significant if nothing is missing."""
    level = gaps.after or gaps.retuned
    is_significant = not is_none
    if gaps.after is not None:
        interval = level.excess_interval()
        least = 1.0 if interval is None else interval[0]
        is_significant = any(map(is_gap_visible, (level.refit.gap, least**2 - 1)))
    forces = evidence.rest_pushed if refit.causes else evidence.pushed
    share = max((force.share for force in forces), default=0.0)
    shares = sorted(compute_force_shares(forces).items(), key=lambda row: -row[1])
    return RestRow(
        excess=level.gap.excess,
        model_error=level.refit.floor,
        significant=is_significant,
        spread="local" if share >= settings.min_local_share else "everywhere",
        where=list_places(shares, settings, is_known=is_significant),
    )


def list_places(
    shares: Sequence[tuple[str, float]], settings: DiagnosisSettings, *, is_known: bool
) -> list[Where]:
    """Return the rows of places; a share is null where nothing is missing."""
    return [
        Where(location=place, share=share if is_known else None)
        for place, share in shares
        if share >= settings.min_row_probability
    ]
