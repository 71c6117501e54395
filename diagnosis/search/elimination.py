"""Backward step of the search: each earlier cause is left out, and dropped or replaced.

A cause that was selected before the others were known may be a proxy of them, or stand at a wrong
place beside them. So each earlier cause is left out in turn. It is dropped if the set without it is
as probable, and more than the selected set. Else the score test about that set proposes other
causes, and the best of these replaces it if the set is more probable (sequential replacement,
Miller 2002, ch. 3). What another cause has replaced may have been all that a third one stood for:
the new set is reconsidered as well.

Beside a law, sets are compared on the tests of one level, with the law held (``one_level``). A set
without a cause is refitted on all levels unless one level shows that the cause belongs to it. So is
a set with another cause in its place that a verdict would list.
"""

from collections.abc import Sequence
from dataclasses import replace

from diagnosis.data_checks.bending_bodies import key_of
from diagnosis.effects import load_catalogue
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.null_model import Baseline
from diagnosis.refits.refit import Refit
from diagnosis.refits.refitting import (
    RefitTask,
    add_cause,
    add_hypotheses,
    find_start,
    limit_floor,
    run_refits,
)
from diagnosis.search.fitted_sets import Search, is_acceptable, is_more_probable
from diagnosis.search.one_level import (
    CauseSearch,
    has_law,
    hold_law,
    refit_on_all_levels,
    select_listed,
)
from diagnosis.search.refit_round import list_excluded, score_hypotheses
from diagnosis.search.score_test import select_best_of_sites
from diagnosis.settings import DiagnosisSettings


def reconsider_causes(
    base: Baseline, search: Search, best: Refit, settings: DiagnosisSettings
) -> tuple[Search, Refit]:
    """Return the search and its best set, each of whose earlier causes was left out in turn.

    Args:
        best: set with one more cause.
    """
    kept_causes = {
        left_out: remaining
        for left_out in best.causes[:-1]
        if (remaining := _list_causes_without(left_out, best.causes, base.scene)) is not None
    }
    if not kept_causes:
        return search, best
    scene = base.scene
    seen = CauseSearch.beside(scene, best, settings).seen
    shorter = _leave_out(scene, search, best, list(kept_causes.values()), settings)
    open_sets = [refit for refit in shorter if not _is_decided(search, seen, refit, settings)]
    without = refit_on_all_levels(scene, open_sets, settings)
    search = replace(search, refits=(*search.refits, *without))
    kept = best
    for refit in without:
        if is_acceptable(search, refit, settings) and not is_more_probable(search, kept, refit):
            kept = refit
    if kept is not best:
        return reconsider_causes(base, search, kept, settings)
    rivals: list[Refit] = []
    for refit, left_out in zip(shorter, kept_causes, strict=True):
        replaced = _replace_cause(base, refit, left_out, settings)
        if has_law(refit):
            small = tuple(map(key_of, base.checks.small))
            listed = select_listed(refit, [seen, *replaced], search.hypotheses, small, settings)
            replaced = [rival for rival in listed if rival is not seen]
        rivals += refit_on_all_levels(scene, replaced, settings)
    search = replace(search, refits=(*search.refits, *rivals))
    for rival in rivals:
        kept = rival if is_more_probable(search, rival, kept) else kept
    return (search, kept) if kept is best else reconsider_causes(base, search, kept, settings)


def _list_causes_without(
    left_out: Hypothesis, causes: Sequence[Hypothesis], scene: Scene
) -> list[Hypothesis] | None:
    """Return all causes of a set but one.

    Parts of the others refer to the coordinates of a body's mode. Without that mode these causes
    are therefore proposed anew; None if one of them is not.

    Args:
        left_out: the cause that is left out.
        causes: the set.
    """
    kept = [cause for cause in causes if cause is not left_out]
    if left_out.reform is None:
        return kept
    wanted = {cause.identity for cause in kept if cause.parts and cause.spring is None}
    proposed = {
        hypothesis.identity: hypothesis
        for effect in load_catalogue().values()
        for hypothesis in effect(scene)
        if wanted and hypothesis.identity in wanted
    }
    anew = [proposed.get(cause.identity) if cause.parts else cause for cause in kept]
    return None if None in anew else [cause for cause in anew if cause is not None]


def _leave_out(
    scene: Scene,
    search: Search,
    best: Refit,
    sets: Sequence[Sequence[Hypothesis]],
    settings: DiagnosisSettings,
) -> list[Refit]:
    """Return the refits of sets that lack one cause of the best one, on one level beside a law.

    Each starts at the error that is left where its cause is only taken away, at most that of the
    null model. At the lower floor of the best set it would settle only after many steps.
    """
    tasks = []
    for causes in sets:
        session = add_hypotheses(scene.session, *causes)
        start = find_start(best, session)
        task = hold_law(RefitTask(tuple(causes), session, start, search.null.floor))
        tasks.append(limit_floor(task, settings.score_stride * scene.stride_factor))
    return run_refits(scene, tasks, settings.schedule)


def _is_decided(search: Search, seen: Refit, refit: Refit, settings: DiagnosisSettings) -> bool:
    """Return whether one level shows that a cause belongs to a set beside a law.

    Args:
        seen: the set on one level.
        refit: the set without the cause.
        settings: what is material.
    """
    if not has_law(refit):
        return False
    view = replace(search, null=refit, selected=refit, refits=())
    is_material = seen.summary.is_material_step(refit.summary, settings.min_closed)
    return is_material and is_more_probable(view, seen, refit)


def _replace_cause(
    base: Baseline, refit: Refit, left_out: Hypothesis, settings: DiagnosisSettings
) -> list[Refit]:
    """Return refits with the most promising other causes in the place of one that is left out."""
    ranked = score_hypotheses(base.scene, refit, list_excluded(base), settings)
    rivals = [
        score.hypothesis
        for score in select_best_of_sites(ranked)
        if score.hypothesis.site != left_out.site and score.hypothesis.spring is None
    ]
    tasks = [add_cause(refit, rival) for rival in rivals[: settings.max_variants]]
    replaced = run_refits(base.scene, tasks, settings.schedule)
    return [rival for rival in replaced if not rival.shows_another_effect]
