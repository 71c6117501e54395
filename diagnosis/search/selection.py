"""Search for the causes: stepwise forward selection with backward elimination and replacement.

Each round scores every hypothesis about the best set so far, and refits the most promising one of
each effect and place together with that set. The best set stays if it is material and probable.
Each earlier cause is left out in turn, and dropped or replaced (``elimination.py``). The last one
is moved to neighbouring bodies (``moved_causes.py``), at the end all of the most probable set.
A further one is found by the next round, from a model that has the first (Draper and Smith 1998,
ch. 15).

While others are missing, an effect may be improbable or close little of the gap. The search
therefore goes on as long as the last cause closes much or makes the set more probable, and a gap
remains that a further one may close. The rounds end after two in a row in which the set did not
become more probable: of two equal effects, the first alone explains too little.

Where a force of any spectrum at one place explains much of what a set leaves, each effect at that
place is refitted, whatever its score: a strong effect may score below weaker ones elsewhere. So is
the place of what the most probable set leaves where the rounds ended with another one.
"""

from collections.abc import Callable
from dataclasses import replace

from diagnosis.data_checks.bending_bodies import key_of
from diagnosis.inference.calibration import load_calibration
from diagnosis.inference.evidence import ForceGain, Key
from diagnosis.null_model import Baseline, refit_from
from diagnosis.refits.refit import Refit
from diagnosis.refits.refitting import admit_outliers
from diagnosis.search.elimination import reconsider_causes
from diagnosis.search.fitted_sets import (
    Search,
    find_leading,
    find_most_probable,
    is_acceptable,
    is_last_material,
    is_more_probable,
)
from diagnosis.search.local_gap import acts_at, find_local_force
from diagnosis.search.moved_causes import move_causes
from diagnosis.search.refit_round import (
    list_excluded,
    push_about,
    refit_round,
    score_hypotheses,
)
from diagnosis.settings import DiagnosisSettings
from tuning import is_gap_visible


def select_causes(
    base: Baseline, settings: DiagnosisSettings, say: Callable[[str], None]
) -> Search:
    """Select the causes that explain the gap of the null model.

    Args:
        say: called with the current step.
    """
    small_faults = tuple(map(key_of, base.checks.small))
    search, path = Search(base.null, base.null, small_faults=small_faults), base.null
    visited: set[frozenset[Key]] = set()
    moved: dict[frozenset[Key], set[Key]] = {}  # causes of sets that were moved to neighbours
    stalled_before = is_stalled = has_ended = False
    while len(path.causes) < settings.max_causes and frozenset(path.keys) not in visited:
        search, force = _locate_gap(base, search, path, settings)
        if has_ended and force is None:
            break
        visited.add(frozenset(path.keys))
        say(f"score tests of all hypotheses for cause {len(path.causes) + 1}")
        ranked = score_hypotheses(base.scene, path, list_excluded(base), settings)
        if has_ended and force is not None:
            ranked = [score for score in ranked if acts_at(score.hypothesis, force.location)]
        say("refits of the most promising hypotheses")
        refits = refit_round(base, path, ranked, settings, force)
        search = replace(
            search, scores=search.scores or tuple(ranked), refits=(*search.refits, *refits)
        )
        promising = [refit for refit in refits if _is_promising(search, refit, path, settings)]
        if promising:
            best = min(promising, key=lambda refit: refit.objective)
            before, (search, path) = path, reconsider_causes(base, search, best, settings)
            search, path = move_causes(base.scene, search, path, path.causes[-1:], settings)
            moved.setdefault(frozenset(path.keys), set()).add(path.keys[-1])
            stalled_before, is_stalled = is_stalled, not is_more_probable(search, path, before)
            if is_acceptable(search, path, settings):
                search = replace(search, selected=path)
        has_ended = (
            not promising
            or (stalled_before and is_stalled)
            or not is_gap_visible(path.gap)
            or len(path.causes) >= settings.max_causes
            or frozenset(path.keys) in visited
        )
        if has_ended:
            search, path = _settle(base, search, moved, settings)
            stalled_before = is_stalled = False
    return search


def _locate_gap(
    base: Baseline, search: Search, refit: Refit, settings: DiagnosisSettings
) -> tuple[Search, ForceGain | None]:
    """Return the force that explains what a set leaves, and the search with all free forces.

    There is none if next to nothing remains, or if it is everywhere.
    """
    if not is_gap_visible(refit.gap):
        return search, None
    forces = search.forces.get(refit) or push_about(base.scene, refit, settings)
    search = replace(search, forces={**search.forces, refit: forces})
    return search, find_local_force(forces, settings)


def _settle(
    base: Baseline,
    search: Search,
    moved: dict[frozenset[Key], set[Key]],
    settings: DiagnosisSettings,
) -> tuple[Search, Refit]:
    """Return the search and its most probable set, whose causes were moved to neighbours.

    Args:
        moved: causes of each set that were moved already.
        settings: schedules and thresholds.
    """
    best = find_most_probable(search, settings)
    done = moved.setdefault(frozenset(best.keys), set())
    remaining = [cause for cause in best.causes if cause.key not in done]
    done.update(best.keys)
    search, _ = move_causes(base.scene, search, best, remaining, settings)
    best = find_most_probable(search, settings)
    return replace(search, selected=best), best


def _is_promising(search: Search, refit: Refit, path: Refit, settings: DiagnosisSettings) -> bool:
    """Return whether the search may go on from a set, be it improbable."""
    return is_more_probable(search, refit, path) or is_last_material(search, refit, settings)


def refit_null_model(base: Baseline, search: Search, settings: DiagnosisSettings) -> Search:
    """Refit the null model from the best set of causes, so that both have equal starts.

    The null model stays if the refit does not make its residual more probable.
    """
    best = min(search.refits, key=lambda refit: refit.objective, default=None)
    if best is None:
        return search
    null = refit_from(base.scene, search.null, best, settings)
    gain = search.null.objective - null.objective
    if gain * null.summary.count_independent(load_calibration()) < settings.twin_nats:
        return search
    (null,) = admit_outliers(base.scene, [null], settings)
    return replace(search, null=null, selected=search.selected if search.selected.causes else null)


def admit_outliers_beside_causes(
    base: Baseline, search: Search, settings: DiagnosisSettings
) -> Search:
    """Return the search with outlying tolerances admitted in the sets that lead.

    These are the most probable set and those that are confounded with it. Tolerances held at their
    bounds would count as an error of the model beside the causes, and hide a small effect.
    """
    leading = find_leading(search, settings)
    admitted = dict(
        zip(map(id, leading), admit_outliers(base.scene, leading, settings), strict=True)
    )
    refits = tuple(admitted.get(id(refit), refit) for refit in search.refits)
    selected = admitted.get(id(search.selected), search.selected)
    return replace(search, refits=refits, selected=selected)
