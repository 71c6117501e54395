"""Rows of what was fitted: each set of causes with its model error, and why it was rejected."""

from collections.abc import Sequence
from dataclasses import dataclass

from diagnosis.inference.calibration import load_calibration
from diagnosis.inference.evidence import Evidence, FittedSet, Key
from diagnosis.inference.posterior import compute_log_odds, select_material_sets
from diagnosis.settings import SETTINGS, DiagnosisSettings
from identification.words import first_by_key

_MIN_LOG_ODDS_DIFFERENCE_NATS = 0.05  # below, two sets are equally probable


@dataclass(frozen=True)
class FittedRow:
    """Best fit of a set of causes.

    Args:
        fit: the fit; that of the null model has no causes.
        closed: part of the null model's gap that the set closes; None without such a gap.
        log_odds: against a model without any cause [nats]; None where the set is not weighed.
        rejection: why the set is not weighed; empty if it is.
    """

    fit: FittedSet
    closed: float | None
    log_odds: float | None
    rejection: str = ""


def fitted_rows(evidence: Evidence, settings: DiagnosisSettings = SETTINGS) -> list[FittedRow]:
    """Return the null model and the best fit of each set of causes, the best fit first.

    Args:
        settings: thresholds of the posterior.
    """
    null = evidence.null
    material = {id(fitted) for fitted in select_material_sets(null, evidence.sets, settings)}
    reasons = [
        _rejection(fitted, id(fitted) in material, evidence, settings) for fitted in evidence.sets
    ]
    rows = zip(evidence.sets, reasons, strict=True)
    ranked = sorted(rows, key=lambda row: (bool(row[1]), row[0].objective))
    best = first_by_key((frozenset(row[0].keys), row) for row in ranked)
    weighed = [fitted for fitted, reason in best.values() if not reason]
    odds = dict(
        zip(weighed, compute_log_odds(evidence, weighed, load_calibration()).tolist(), strict=True)
    )

    def close(fitted: FittedSet) -> float | None:
        return (null.gap - fitted.gap) / null.gap if null.gap > 0 else None

    sets = [FittedRow(null, close(null), 0.0)]
    sets += [
        FittedRow(fitted, close(fitted), odds.get(fitted), reason)
        for fitted, reason in best.values()
    ]
    return sorted(sets, key=lambda row: row.fit.objective)


def key_words(key: Key) -> str:
    """Return a cause as the verdict names it, such as ``appendage at body:ty tz``."""
    effect, location, dof = key
    return f"{effect} at {location}{f' {dof}' if dof else ''}"


def rejection_reasons(rows: Sequence[FittedRow], present: frozenset[Key]) -> list[str]:
    """Return why each set of causes is not the verdict's; empty for that of the verdict.

    Args:
        rows: sets that were fitted.
        present: causes that the verdict names.
    """
    most = max((row.log_odds for row in rows if row.log_odds is not None), default=0.0)
    return [_reason(row, present, most) for row in rows]


def _reason(row: FittedRow, present: frozenset[Key], most: float) -> str:
    if frozenset(row.fit.keys) == present:
        return ""
    if row.log_odds is None:
        return row.rejection
    less = most - row.log_odds
    if less > _MIN_LOG_ODDS_DIFFERENCE_NATS:
        return "less probable"
    return "improbable"


def is_outlier(fitted: FittedSet, settings: DiagnosisSettings) -> bool:
    """Return whether a cause only releases tolerances that shift by no more than an outlier."""
    return any(shift is not None and shift <= settings.outlier_sigma for shift in fitted.shifts)


def _rejection(
    fitted: FittedSet, is_material: bool, evidence: Evidence, settings: DiagnosisSettings
) -> str:
    """Return why a set is not weighed; empty if it is."""
    if is_outlier(fitted, settings):
        return f"pull < {settings.outlier_sigma:g}"
    if not is_material:
        verb = "closes" if len(fitted.keys) == 1 else "one cause adds"
        return f"{verb} < {100 * settings.min_closed:g} %"
    if set(fitted.keys) in map(set, evidence.rejected):
        return "fails on held-out lines"
    if not evidence.admits(fitted.keys):
        return "contains a set that fails on held-out lines"
    return ""
