"""Fits of the null model, without any effect; ``inference.posterior`` decides from their gap.

Springs, dampers and tolerances have other minima than the one that a start at the drawing leads to,
and a gap that only such a minimum leaves is none.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from diagnosis.data_checks.sensors import Gate
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
    paced,
    plenty,
    pull_of,
    refit,
    uninterrupted,
)
from diagnosis.search.ladder import Search
from identification import lines_are_independent
from identification.words import Campaign
from mbmodel import RigidDirection
from tuning import STAGES, TOLERANCE_BOUND_SIGMA, Fit, Session, fit, random_starts

_FEW, _STARTS, _FOLLOWED = 48, 16, 4  # FRFs a start; at most so many, of which the best go on
_OTHERS, _MOST = 2, 0.5  # so many, that leave no more of the gap, say where nothing might begin
_LESS = 0.9  # of the cost of first steps: who comes below has found another minimum
_LITTLE = 0.1  # of the variance: where so little is left of much data, more of them count


def fit_with_floor(
    session: Session,
    gate: Gate,
    held: tuple[RigidDirection, ...],
    jobs: int,
    say: Callable[[str], None],
) -> tuple[Scene, Fit]:
    """The fit with an allowance, to what no gate took out."""
    say("fit with an allowance")
    clean = replace(session, campaign=gate.campaign)
    pace = _pace(clean.campaign)
    early = uninterrupted(
        fit(
            clean.model,
            clean.campaign,
            parametrisation=clean.parametrisation,
            stages=paced(STAGES[:3], pace),
            jobs=jobs,
        )
    )
    own = lines_are_independent(session.campaign)
    return Scene(clean, early.theta, held, pace, jobs, independent=own), early


def refit_null_model(scene: Scene, say: Callable[[str], None]) -> tuple[Scene, Refit, Refit]:
    """First steps and the end of the fit without any effect, and the scene from where it began."""
    say("refit without any effect")
    campaign = scene.session.campaign
    first = refit(scene, None, campaign, FIRST)
    nothing = go_on(scene, first, PATIENT)
    best = from_many_starts(scene, nothing, say)
    if best.cost < nothing.cost:  # hypotheses begin there too: else they end worse than nothing
        scene, nothing = replace(scene, theta=best.fit.theta), best
        first = refit(scene, None, campaign, FIRST)
    return scene, first, nothing


def refit_by_more_lines(scene: Scene, first: Refit, nothing: Refit) -> tuple[Scene, Refit, Refit]:
    """The same by as many lines as of little data, where little is left of much.

    Three levels are fitted to every twelfth line: what that leaves of a strong one between them,
    0.0175 of the noise where all parameters were right, is no gap; every fourth leaves 0.0054.
    """
    if scene.pace == 1 or nothing.is_noise or nothing.gap > _LITTLE:
        return scene, first, nothing
    scene = replace(scene, pace=1)
    first = refit(scene, None, scene.session.campaign, FIRST)
    return scene, first, go_on(scene, nothing, PATIENT[-1:])


def _pace(campaign: Campaign) -> int:
    """How many times as much was measured as fits need."""
    return max(1, round(plenty(campaign)))


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
            parametrisation=session.parametrisation,
            starts=random_starts(session.model, count, 0, parametrisation=session.parametrisation),
            stages=STAGES[:3],
            jobs=scene.jobs,
        )
    )
    order = np.argsort(found.start_costs)[:_FOLLOWED]
    starts = [replace(scene, theta=theta) for theta in found.start_thetas[order]]
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
    beyond = loose.fit.parametrisation.has_prior & (np.abs(loose.fit.x) > TOLERANCE_BOUND_SIGMA)
    if pull > outlier or not beyond.any():
        return scene, replace(made, loose=1 + loose.gap, pull=pull)
    session = replace(
        made.session, parametrisation=made.session.parametrisation.widen_bounds(beyond, outlier)
    )
    wide = replace(scene, session=replace(scene.session, parametrisation=session.parametrisation))
    found = go_on(wide, replace(loose, session=session), LAST)
    return wide, replace(found, loose=1 + found.gap, pull=pull_of(found))


def within_bounds(scene: Scene, made: Refit, outlier: float) -> Refit:
    """The same, tolerances that were taken for outliers within their bounds again."""
    before = made.session.parametrisation
    varies = before.narrow_bounds(outlier)
    if np.array_equal(varies.lower, before.lower) and np.array_equal(varies.upper, before.upper):
        return made
    x = np.clip(varies.coordinates(made.fit.theta), varies.lower, varies.upper)
    begun = replace(made.fit, parametrisation=varies, x=x)
    session = replace(made.session, parametrisation=varies)
    return go_on(scene, replace(made, session=session, fit=begun), LAST)
