"""Gap at each level of the hits, and at a level that the fits did not see.

A law of a joint must close the gap at every level, not at that of the largest gap alone. The middle
level is foretold as well: null model and causes are fitted to the other levels, at the model error
of their refits, and predict it (cross-validation by level). A law is then simulated about the
linear machine of all levels, which the tests of the middle level hardly move.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace

from diagnosis.estimates.held_out_gap import GapEstimates
from diagnosis.hypothesis import Scene
from diagnosis.levels.free_levels import LAW_EFFECTS, list_levels
from diagnosis.refits.refit import Refit
from identification.words import Campaign, Complex
from tuning import Gap, channel_gaps, fit, predict, summarise_gaps
from tuning.workers.independent_calls import Call, run_in_parallel


@dataclass(frozen=True)
class GapAtLevel:
    """Gap of the tests of one level.

    Args:
        level_n: peak of their hits [N, or ``unit``].
        retuned: gap of the null model.
        after: gap with all causes.
        unit: unit of the level.
    """

    level_n: float
    retuned: Gap
    after: Gap
    unit: str = "N"


@dataclass(frozen=True)
class LevelGaps:
    """Gap at each level.

    Args:
        levels: held-out gap of each, the lowest first.
        foretold: gap at a level that the fits did not see; None without a cause that depends on
            the level, or with less than three levels.
    """

    levels: tuple[GapAtLevel, ...]
    foretold: GapAtLevel | None = None


def estimate_gaps_by_level(scene: Scene, gaps: GapEstimates) -> LevelGaps | None:
    """Return the gap at each level; None for a campaign of one level, or without a cause.

    Args:
        scene: processes.
        gaps: held-out gaps without and with the causes.
    """
    before, after = gaps.retuned, gaps.after
    levels = list_levels(before.campaign)
    if len(levels) < 2 or after is None:
        return None
    unit = before.campaign.tests[0].condition.drive_unit
    rows = tuple(
        GapAtLevel(
            level,
            _compute_gap(before.predicted, before.campaign, level),
            _compute_gap(after.predicted, after.campaign, level),
            unit,
        )
        for level in levels
    )
    has_law = any(cause.effect in LAW_EFFECTS for cause in after.refit.causes)
    if len(levels) < 3 or not has_law:
        return LevelGaps(rows)
    middle = levels[len(levels) // 2]
    calls: list[Call] = [
        (foretell_level, (replace(held.refit, hypothesis=None), middle)) for held in (before, after)
    ]
    retuned, with_causes = run_in_parallel(calls, scene.jobs)
    return LevelGaps(rows, GapAtLevel(middle, retuned, with_causes, unit))


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


def _compute_gap(predicted: tuple[Complex, ...], campaign: Campaign, level_n: float) -> Gap:
    values = [
        rows
        for rows, test in zip(predicted, campaign.tests, strict=True)
        if test.condition.level_n == level_n
    ]
    return summarise_gaps(channel_gaps(values, _select_levels(campaign, {level_n})))


def _select_levels(campaign: Campaign, levels: Collection[float | None]) -> Campaign:
    tests = tuple(test for test in campaign.tests if test.condition.level_n in levels)
    return replace(campaign, tests=tests)
