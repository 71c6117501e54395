"""Refits from the drawing: a fit without a strong cause may end in a basin of its own.

There a stiffness is at the end of its range, and dozens of tolerances are at their bounds. A refit
with the right cause that begins in that basin stays in it. So where no refit about the null model
leaves next to nothing, each is begun anew as a tuning is: from the drawing, by the logarithm of the
FRFs, with the tolerances held. The sets that leave least then are refitted from there.

A member of a family begins at a direction that the score test gives it about the null model. Where
stiffness was tuned without it, the fit may end beside the minimum; so the best one is begun anew in
that direction, now from its own stiffness.
"""

from collections.abc import Sequence
from dataclasses import replace

from diagnosis.hypothesis import Scene
from diagnosis.refits.refit import Refit
from diagnosis.refits.refitting import (
    RefitTask,
    add_hypotheses,
    estimate_start_error,
    find_start,
    run_refits,
)
from diagnosis.search.score_test import Score
from diagnosis.settings import DiagnosisSettings
from identification.words import Real
from tuning import STAGES, Session, Stage, fit, is_gap_visible
from tuning.workers.independent_calls import Call, run_in_parallel

_FIRST_STAGES = STAGES[:2]  # without tolerances


def refit_from_drawing(
    scene: Scene, refits: Sequence[Refit], settings: DiagnosisSettings
) -> list[Refit]:
    """Return further refits of the sets that leave least after their first stages.

    Args:
        scene: null model.
        refits: sets of causes, refitted from the null model; if one leaves next to nothing, none
            begins anew.
        settings: schedule, and the number of further starts.
    """
    if not all(is_gap_visible(refit.gap) for refit in refits):
        return []
    schedule = settings.schedule.thin(len(scene.session.campaign.freq_hz), scene.stride_factor)
    factor = schedule.first_stride_factor
    stages = tuple(replace(stage, stride=stage.stride * factor) for stage in _FIRST_STAGES)
    drawn = replace(scene, theta=scene.model.drawn)
    calls: list[Call] = []
    for refit in refits:
        start = find_start(drawn, refit.session, *refit.causes)
        calls.append((_fit_first_stages, (refit.session, start, stages)))
    begun = []
    for refit, theta in zip(refits, run_in_parallel(calls, scene.jobs), strict=True):
        task = RefitTask(refit.causes, refit.session, theta, refit.floor)
        error = estimate_start_error(task, max(1, schedule.stride // 2))
        if error is not None:
            begun.append((error.cost / error.values, replace(task, floor=error.floor)))
    best = sorted(begun, key=lambda pair: pair[0])[: settings.max_variants]
    ended = run_refits(scene, [task for _, task in best], settings.schedule)
    return [refit for refit in ended if not refit.shows_another_effect]


def refit_members_anew(
    scene: Scene,
    seen: Refit,
    ranked: Sequence[Score],
    refits: Sequence[Refit],
    settings: DiagnosisSettings,
) -> list[Refit]:
    """Return refits of the best cause's family from its parameters; none where it is of no family.

    Args:
        scene: null model.
        seen: set beside which the causes were refitted.
        ranked: scores of all hypotheses, the most promising first.
        refits: of the set with one more cause.
        settings: schedule, and the number of further starts.
    """
    best = min(refits, key=lambda refit: refit.objective)
    members = [
        score.hypothesis
        for score in ranked
        if score.is_of_family and score.hypothesis.site == best.causes[-1].site
    ]
    tasks = []
    for member in members[: 1 + settings.max_variants]:
        session = add_hypotheses(seen.session, member)
        start = find_start(best, session, member)
        tasks.append(RefitTask((*seen.causes, member), session, start, best.floor))
    return run_refits(scene, tasks, settings.schedule)


def _fit_first_stages(session: Session, start: Real, stages: tuple[Stage, ...]) -> Real:
    """Return the parameters after some stages [SI]; (n_parameter,)."""
    reached = fit(
        session.model,
        session.campaign,
        parametrisation=session.parametrisation,
        starts=(start,),
        stages=stages,
    )
    if reached.outcome == "interrupted":
        raise KeyboardInterrupt
    return reached.theta
