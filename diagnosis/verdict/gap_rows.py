"""Rows of gaps for verdict.json: at each step, and at each level of the hits."""

from diagnosis.estimates.gap_by_level import GapAtLevel, LevelGaps
from diagnosis.verdict.schema import LevelGapRow
from tuning import MIN_VISIBLE_EXCESS, Gap
from tuning.files.schema import GapRow


def find_closed_part(retuned: Gap, after: Gap) -> float | None:
    """Return the part of the gap beyond noise that the causes close; None without such a gap."""
    if after.excess is None or retuned.excess is None or retuned.excess <= 1:
        return None
    return float((retuned.excess**2 - after.excess**2) / (retuned.excess**2 - 1))


def list_level_rows(gaps: LevelGaps | None) -> tuple[list[LevelGapRow], LevelGapRow | None]:
    """Return the rows of all levels, and that of the level that is foretold."""
    if gaps is None:
        return [], None
    foretold = None if gaps.foretold is None else _build_level_row(gaps.foretold)
    return [_build_level_row(level) for level in gaps.levels], foretold


def _build_level_row(level: GapAtLevel) -> LevelGapRow:
    retuned = level.retuned
    is_visible = retuned.excess is not None and retuned.excess >= MIN_VISIBLE_EXCESS
    return LevelGapRow(
        level=level.level_n,
        unit=level.unit,
        retuned=GapRow.model_validate(retuned),
        after=GapRow.model_validate(level.after),
        closed=find_closed_part(retuned, level.after) if is_visible else None,
    )
