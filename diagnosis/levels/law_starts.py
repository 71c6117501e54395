"""Where the refit of a law begins: its parameters fitted to the FRFs, the rest of the machine held.

The joint direction was refitted with a stiffness and damping of its own at each level. About that
machine, a law and the linear spring and damper in parallel with it are fitted alone. Whatever they
are, the FRFs follow by an update of rank one (``joint_update``). A law thus costs its simulation
and nothing else, and many starts go through time together; the solvers of ``tuning`` evaluate one
start at a time.

A law has several minima: a gap acts from its middle, or from either side of it. So each family
begins at its best start, and the best families are fitted by Levenberg-Marquardt steps at the model
error that their residuals show. Derivatives are difference quotients of the simulated stiffness.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from diagnosis.hypothesis import JointDirection, Scene
from diagnosis.levels.law_alone import LawAlone, LawStart, TriedLaw
from diagnosis.levels.law_family import FAMILIES, LOOSE_GAP, LawFamily
from diagnosis.levels.settings import LEVEL_SETTINGS
from identification.words import Complex, Real
from tuning.workers.independent_calls import Call, run_in_parallel


def fit_starts(
    scene: Scene,
    joint: JointDirection,
    effects: Sequence[str],
    stiffest: float,
    least_damping: float,
) -> list[LawStart]:
    """Return the best start of each effect, and perhaps one of a loose gap.

    A joint whose gap is not left at the lowest level has no spring there. The machine with free
    levels is then far from the right one, and a law fitted alone tells nothing of such a gap. A
    start of it is therefore added, not fitted alone, if the joint is stiffer at a higher level.

    Args:
        scene: linear machine at the lowest level.
        stiffest: largest stiffness of the joint at any level.
        least_damping: least damping at any level.
    """
    alone = LawAlone.of_scene(scene, joint, stiffest)
    calls: list[Call] = [(_fit_effect, (alone, effect, least_damping)) for effect in effects]
    starts: list[LawStart] = list(run_in_parallel(calls, scene.jobs))
    least_gap = LEVEL_SETTINGS.loose_gap_shares[0] * alone.middle_stretch
    is_tight = any(
        start.family.effect == LOOSE_GAP.effect and start.theta[0] < least_gap for start in starts
    )
    if is_tight and stiffest > alone.tested.stiffness:
        loose = _find_best_start(alone, LOOSE_GAP, least_damping)
        starts += [replace(alone.build_start(point), is_loose=True) for point in loose]
    return starts


def _fit_effect(alone: LawAlone, effect: str, least_damping: float) -> LawStart:
    """Return the best law of an effect, its best families fitted."""
    best = []
    for family in FAMILIES[effect]:
        best += _find_best_start(alone, family, least_damping)
    if not best:
        raise ValueError(f"{effect} has no law that holds")
    best = sorted(best, key=lambda point: point.error.cost)[: LEVEL_SETTINGS.fitted_families]
    return alone.build_start(min(_fit_points(alone, best), key=lambda point: point.error.cost))


def _find_best_start(alone: LawAlone, family: LawFamily, least_damping: float) -> list[TriedLaw]:
    """Return the best start of a family; none if the motion of all grows without bound."""
    starts = [(family, values) for values in alone.list_starts(family, least_damping)]
    return sorted(filter(None, alone.evaluate(starts)), key=lambda point: point.error.cost)[:1]


def _fit_points(alone: LawAlone, points: list[TriedLaw]) -> list[TriedLaw]:
    """Return laws after Levenberg-Marquardt steps, all of them at once."""
    dampings = [LEVEL_SETTINGS.start_damping] * len(points)
    working = list(range(len(points)))
    for _ in range(LEVEL_SETTINGS.start_steps):
        if not working:
            break
        moves = [(points[k].family, values) for k in working for values in _list_moves(points[k])]
        at = iter(alone.evaluate(moves))
        tried: list[tuple[LawFamily, Real]] = []
        for k in working:
            slopes = np.array([_find_slope(points[k], next(at)) for _ in points[k].values])
            weights = alone.update.weights(points[k].error)
            step = _solve_step(slopes, points[k], weights, dampings[k])
            tried.append((points[k].family, alone.limit(points[k].family, _move(points[k], step))))
        settled = []
        for k, end in zip(working, alone.evaluate(tried), strict=True):
            gain = -np.inf if end is None else points[k].error.cost - end.error.cost
            factor = LEVEL_SETTINGS.damping_factor
            dampings[k] *= 1 / factor if gain > 0 else factor
            if end is not None and gain > 0:
                points[k] = end
            if 0 < gain < LEVEL_SETTINGS.settled_nats * points[k].error.values:
                settled.append(k)
        working = [k for k in working if k not in settled]
    return points


def _list_moves(point: TriedLaw) -> list[Real]:
    """Return the values of a law with one coordinate moved each."""
    steps = LEVEL_SETTINGS.difference_step * np.eye(len(point.values))
    return [_move(point, step) for step in steps]


def _move(point: TriedLaw, step: Real) -> Real:
    """Return the values of a law after a step of its coordinates: logarithms of sizes."""
    is_size = _list_sizes(point)
    limited = np.clip(step, -LEVEL_SETTINGS.largest_start_step, LEVEL_SETTINGS.largest_start_step)
    return np.where(is_size, point.values * np.exp(limited), point.values + limited)


def _list_sizes(point: TriedLaw) -> Real:
    """Return which values are positive sizes, as the joint's stiffness and damping are."""
    return np.array([*point.family.is_size[: point.family.count], True, True])


def _find_slope(point: TriedLaw, moved: TriedLaw | None) -> Complex:
    """Return the derivative of the residuals by a coordinate; zero where the motion diverges."""
    if moved is None:
        return np.zeros_like(point.residuals)
    return (moved.residuals - point.residuals) / LEVEL_SETTINGS.difference_step


def _solve_step(slopes: Complex, point: TriedLaw, weights: Real, damping: float) -> Real:
    """Return the damped Gauss-Newton step; slopes (n_coordinate, n_value)."""
    normal = ((slopes.conj() * weights) @ slopes.T).real
    gradient = ((slopes.conj() * weights) @ point.residuals).real
    scale = np.sqrt(np.maximum(np.diag(normal), np.finfo(float).tiny))
    unit = normal / np.outer(scale, scale) + damping * np.eye(len(scale))
    return -np.linalg.solve(unit, gradient / scale) / scale
