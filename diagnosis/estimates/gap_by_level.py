"""Gap at each level of the hits, and at a level that the fits did not see.

A law of a joint must close the gap at every level, not at that of the largest gap alone. The middle
level is foretold as well: null model and causes are fitted to the other levels, at the model error
of their refits, and predict it (cross-validation by level). A law is then simulated about the
linear machine of all levels, which the tests of the middle level hardly move.
"""

from collections.abc import Collection
from dataclasses import replace

from diagnosis.estimates.held_out_gap import GapEstimates, HeldOutGap
from diagnosis.hypothesis import Scene
from diagnosis.levels.free_levels import LAW_EFFECTS, list_levels
from diagnosis.refits.refit import Refit
from identification.readers.result_files import StrictRow
from identification.words import Campaign
from tuning import MIN_VISIBLE_EXCESS, Gap, channel_gaps, fit, predict, summarise_gaps
from tuning.files.schema import GapRow
from tuning.workers.independent_calls import Call, run_in_parallel


class LevelGapRow(StrictRow):
    """Gap of the tests of one level, without and with all causes; ``unit`` is that of the level."""

    level: float
    unit: str = "N"
    retuned: GapRow
    after: GapRow
    closed: float | None


def find_closed_part(retuned: Gap, after: Gap) -> float | None:
    """Return the part of the gap beyond noise that the causes close; None without such a gap."""
    if after.excess is None or retuned.excess is None or retuned.excess <= 1:
        return None
    return float((retuned.excess**2 - after.excess**2) / (retuned.excess**2 - 1))


def estimate_gaps_by_level(
    scene: Scene, gaps: GapEstimates
) -> tuple[list[LevelGapRow], LevelGapRow | None]:
    """Return the held-out gap at each level, the lowest first, and that at a level left out.

    Args:
        scene: processes.
        gaps: held-out gaps without and with the causes.

    Returns:
        No gaps for a campaign of one level, or without a cause. None is foretold without a cause
        that depends on the level, or with less than three levels.
    """
    before, after = gaps.retuned, gaps.after
    levels = list_levels(before.campaign)
    if len(levels) < 2 or after is None:
        return [], None
    unit = before.campaign.tests[0].condition.drive_unit
    rows = [
        _build_row(level, unit, _compute_gap(before, level), _compute_gap(after, level))
        for level in levels
    ]
    has_law = any(cause.effect in LAW_EFFECTS for cause in after.refit.causes)
    if len(levels) < 3 or not has_law:
        return rows, None
    middle = levels[len(levels) // 2]
    calls: list[Call] = [
        (foretell_level, (replace(held.refit, causes=()), middle)) for held in (before, after)
    ]
    retuned, with_causes = run_in_parallel(calls, scene.jobs)
    return rows, _build_row(middle, unit, retuned, with_causes)


def foretell_level(refit: Refit, level_n: float) -> Gap:
    """Return the gap at a level of a fit to the tests of all other levels.

    Args:
        refit: refit to all levels, from which the fit begins.
        level_n: the level that is left out.

    Raises:
        KeyboardInterrupt: interrupted.
    """
    session, whole = refit.session, refit.fit
    campaign = session.campaign
    fitted_levels = {test.condition.level_n for test in campaign.tests} - {level_n}
    without = fit(
        session.model,
        _select_levels(campaign, fitted_levels),
        parametrisation=session.parametrisation,
        starts=(whole.theta,),
        stages=() if whole.last_stage is None else (whole.last_stage,),
    )
    if without.outcome == "interrupted":
        raise KeyboardInterrupt
    left_out = _select_levels(campaign, {level_n})
    return summarise_gaps(channel_gaps(predict(session.model, without.theta, left_out), left_out))


def _build_row(level: float, unit: str, retuned: Gap, after: Gap) -> LevelGapRow:
    is_visible = retuned.excess is not None and retuned.excess >= MIN_VISIBLE_EXCESS
    return LevelGapRow(
        level=level,
        unit=unit,
        retuned=GapRow.model_validate(retuned),
        after=GapRow.model_validate(after),
        closed=find_closed_part(retuned, after) if is_visible else None,
    )


def _compute_gap(held_out: HeldOutGap, level_n: float) -> Gap:
    campaign = held_out.campaign
    values = [
        rows
        for rows, test in zip(held_out.predicted, campaign.tests, strict=True)
        if test.condition.level_n == level_n
    ]
    return summarise_gaps(channel_gaps(values, _select_levels(campaign, {level_n})))


def _select_levels(campaign: Campaign, levels: Collection[float | None]) -> Campaign:
    tests = tuple(test for test in campaign.tests if test.condition.level_n in levels)
    return replace(campaign, tests=tests)
