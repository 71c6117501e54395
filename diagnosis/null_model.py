"""The fit without any effect, whose end says whether anything is missing: it must be the best one.

Springs, dampers and tolerances have other minima than the one that a start at the drawing leads to,
and a gap that only such a minimum leaves is none.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from diagnosis.hypothesis import Scene
from diagnosis.refits.refitting import (
    FIRST,
    LAST,
    PATIENT,
    Refit,
    asked,
    begun_at,
    fitted,
    free,
    further,
    go_on,
    measured,
    pull_of,
    uninterrupted,
)
from diagnosis.search.ladder import Search
from tuning import BOUND, STAGES, fit, random_starts

_FEW, _STARTS, _FOLLOWED = 48, 16, 4  # FRFs a start; at most so many, of which the best go on
_OTHERS, _MOST = 2, 0.5  # so many, that leave no more of the gap, say where nothing might begin
_LESS = 0.9  # of the cost of first steps: who comes below has found another minimum


def from_many_starts(scene: Scene, nothing: Refit, say: Callable[[str], None]) -> Refit:
    """The fit without any effect, of few FRFs from many starts, if one ends better.

    A handful of FRFs is met by several machines, most of them not quite: one start finds any.

    Args:
        scene: campaign and drawn model.
        nothing: the end of the fit from the drawing.
        say: told what is being done.
    """
    session = scene.session
    count = min(_STARTS, round(_FEW / max(1, measured(session.campaign))))
    if count < 2 or nothing.is_noise:
        return nothing
    say("few FRFs: refit without any effect from other starts")
    found = uninterrupted(
        fit(
            session.model,
            session.campaign,
            varies=session.freedom,
            starts=random_starts(session.model, count, 0, varies=session.freedom),
            stages=STAGES[:3],
            jobs=scene.jobs,
        )
    )
    order = np.argsort(found.costs)[:_FOLLOWED]
    starts = [replace(scene, theta=theta) for theta in found.ends[order]]
    tasks = [asked(one, None, session.campaign, (*FIRST, *PATIENT)) for one in starts]
    return min(nothing, *fitted(scene, tasks), key=lambda one: one.cost)


def from_where_others_ended(scene: Scene, first: Refit, nothing: Refit, found: Search) -> Refit:
    """The fit without any effect, from where the best with one ended, if that ends better.

    An effect may lead round a barrier that springs and dampers alone do not cross, and then vanish:
    a joint far softer than drawn, found as supports that are lost. First steps, of few lines, tell.

    Args:
        scene: campaign and drawn model.
        first: first steps of the fit without any effect.
        nothing: its end.
        found: what was tried.
    """
    gap = nothing.gap
    others = [one for one in found.refits[:_OTHERS] if one.gap < _MOST * gap]
    begun = fitted(scene, [begun_at(further(nothing, FIRST), one) for one in others])
    best = min(begun, key=lambda one: one.cost, default=None)
    if best is None or best.cost > _LESS * first.cost:
        return nothing
    again = go_on(scene, best, PATIENT)
    return again if again.cost < nothing.cost else nothing


def with_outliers(scene: Scene, made: Refit, outlier: float) -> tuple[Scene, Refit]:
    """Scene and refit, tolerances that lie beyond their bounds as far as an outlier may.

    Of 300 tolerances some four are beyond 2.5 standard deviations. Where data are exact, what their
    bounds leave is a gap, which effects then seem to explain that are not there.

    Args:
        scene: whose tolerances are within their bounds.
        made: the refit without any effect.
        outlier: standard deviations; where one is farther something is wrong, and nothing changes.

    Returns:
        Both, and what the fit without any bounds leaves, is said of the refit.
    """
    loose = free(scene, made)
    pull = pull_of(loose)
    beyond = loose.fit.freedom.has_prior & (np.abs(loose.fit.x) > BOUND)
    if pull > outlier or not beyond.any():
        return scene, replace(made, loose=1 + loose.gap, pull=pull)
    session = replace(made.session, freedom=made.session.freedom.widened(beyond, outlier))
    wide = replace(scene, session=replace(scene.session, freedom=session.freedom))
    found = go_on(wide, replace(loose, session=session), LAST)
    return wide, replace(found, loose=1 + found.gap, pull=pull_of(found))


def within_bounds(scene: Scene, made: Refit, outlier: float) -> Refit:
    """The same, tolerances that were taken for outliers within their bounds again."""
    before = made.session.freedom
    varies = before.narrowed(outlier)
    if np.array_equal(varies.lower, before.lower) and np.array_equal(varies.upper, before.upper):
        return made
    x = np.clip(varies.coordinates(made.fit.theta), varies.lower, varies.upper)
    begun = replace(made.fit, freedom=varies, x=x)
    session = replace(made.session, freedom=varies)
    return go_on(scene, replace(made, session=session, fit=begun), LAST)
