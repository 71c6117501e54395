"""Causes of a set moved to neighbouring bodies, with their fitted values.

An effect at a body resembles the same effect at a body that a stiff joint joins to it, as a link to
either of two granites, or that a constraint of a closed chain ties to it. Each moved cause starts
at the same place in space with the same values, so that the fit stays in the basin of the set it
comes from. A fit from no effect at all may end in a worse one, and a score test ranks a strong
effect at its neighbour below weak ones elsewhere.
"""

from collections.abc import Container, Iterator, Sequence
from dataclasses import replace

import numpy as np

from diagnosis.effects import load_catalogue
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.inference.evidence import Key
from diagnosis.refits.refit import Refit, map_values
from diagnosis.refits.refitting import (
    RefitTask,
    add_hypotheses,
    find_start,
    limit_floor,
    run_refits,
)
from diagnosis.scene_points import are_joined
from diagnosis.search.fitted_sets import Search, is_more_probable
from diagnosis.search.one_level import CauseSearch, has_law, hold_law, refit_on_all_levels
from diagnosis.search.refit_round import move_scene
from diagnosis.settings import DiagnosisSettings
from mbmodel import Machine


def move_causes(
    scene: Scene,
    search: Search,
    best: Refit,
    causes: Sequence[Hypothesis],
    settings: DiagnosisSettings,
) -> tuple[Search, Refit]:
    """Return the search and its best set, after moves of single causes until none is better.

    A cause that is better elsewhere is moved on from there.

    Beside a law a move is fitted to one level, and to all if it is better there.

    Args:
        best: set whose causes are moved.
        causes: causes of the set that are moved, one in each refit.
    """
    visited: set[frozenset[Key]] = set()
    while frozenset(best.keys) not in visited and any(cause.movable for cause in causes):
        visited.add(frozenset(best.keys))
        seen = CauseSearch.beside(scene, best, settings).seen
        tasks = [
            limit_floor(hold_law(task), settings.score_stride * scene.stride_factor)
            for task in _list_moves(scene, seen, causes, visited, search.null.floor)
        ]
        moved = [
            refit
            for refit in run_refits(scene, tasks, settings.schedule)
            if not refit.shows_another_effect
            and (not has_law(refit) or refit.objective < seen.objective)
        ]
        moved = refit_on_all_levels(scene, moved, settings)
        search = replace(search, refits=(*search.refits, *moved))
        for refit in moved:
            best = refit if is_more_probable(search, refit, best) else best
        causes = best.causes[-1:]
    return search, best


def _list_moves(
    scene: Scene,
    fitted: Refit,
    causes: Sequence[Hypothesis],
    visited: Container[frozenset[Key]],
    floor: float,
) -> Iterator[RefitTask]:
    """Yield the refits of a set with one of its causes moved to a neighbour, which is last then.

    Args:
        fitted: the set.
        causes: causes of the set that are moved.
        visited: sets from which causes were moved already.
        floor: relative model error at the start of the refits.
    """
    for cause in causes:
        kept = [stays for stays in fitted.causes if stays is not cause]
        session = add_hypotheses(scene.session, *kept)
        for moved in _list_moved(scene, fitted, cause):
            if frozenset((*(stays.key for stays in kept), moved.key)) in visited:
                continue
            whole = add_hypotheses(session, moved)
            start = find_start(fitted, whole, moved)
            yield RefitTask((*kept, moved), whole, start, floor)


def _list_moved(scene: Scene, fitted: Refit, cause: Hypothesis) -> Iterator[Hypothesis]:
    """Yield a cause at each neighbour, which starts at its fitted values."""
    if cause.movable is None:
        return
    present = {present_cause.site for present_cause in fitted.causes}
    shapes: dict[str, list[Hypothesis]] = {}
    for hypothesis in load_catalogue()[cause.effect](move_scene(scene, fitted)):
        shapes.setdefault(hypothesis.site, []).append(hypothesis)
    names = [_name_shape(hypothesis) for hypothesis in shapes.get(cause.site, ())]
    if _name_shape(cause) not in names:
        return
    shape = names.index(_name_shape(cause))
    values = cause.movable.read(map_values(fitted.session.parametrisation, fitted.fit.theta))
    for site, rivals in shapes.items():
        rival = rivals[min(shape, len(rivals) - 1)]
        if site in present or rival.movable is None:
            continue
        if _are_neighbours(scene.model.machine, cause.movable.bodies, rival.movable.bodies):
            begin = rival.movable.start(values)
            if rival.member is not None:
                member = rival.member(np.array([begin[name] for name in rival.coordinates]))
                if member is None:
                    continue
                rival, begin = member, {**member.begin, **begin}
            yield replace(rival, begin=_limit(rival, begin))


def _name_shape(hypothesis: Hypothesis) -> str | tuple[str, ...]:
    """Return what tells the shape of a hypothesis from others of its scan."""
    shape = "" if hypothesis.movable is None else hypothesis.movable.shape
    return shape or hypothesis.coordinates


def _are_neighbours(machine: Machine, bodies: tuple[str, ...], moved: tuple[str, ...]) -> bool:
    """Return whether bodies differ in one, and a joint or constraint joins the two that differ."""
    gone, new = {*bodies} - {*moved}, {*moved} - {*bodies}
    if not len(gone) == len(new) == 1:
        return False
    return are_joined(machine, *gone, *new) or gone | new in machine.drawing.ties


def _limit(hypothesis: Hypothesis, values: dict[str, float]) -> dict[str, float]:
    """Return start values within the bounds of a hypothesis."""
    return {
        name: float(np.clip(value, *hypothesis.bounds.get(name, (-np.inf, np.inf))))
        for name, value in values.items()
    }
