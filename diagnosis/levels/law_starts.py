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
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.hypothesis import JointDirection, Scene
from diagnosis.levels.free_levels import list_levels
from diagnosis.levels.joint_update import JointUpdate
from diagnosis.levels.law_family import FAMILIES, LawFamily
from diagnosis.levels.law_simulation import compute_peak_stretch
from diagnosis.levels.settings import LEVEL_SETTINGS
from diagnosis.levels.tested_joint import TestedJoint
from identification.words import Complex, Real
from tuning import thin_lines
from tuning.assessment.model_error import ModelError


@dataclass(frozen=True, eq=False)
class LawStart:
    """A law, and where its refit begins.

    Args:
        joint: direction of the joint.
        family: of the law.
        theta: its parameters.
        parallel: stiffness and damping of the joint's linear spring and damper in parallel; (2,).
        cost: -ln L of the FRFs with it per value, but for a constant [nats].
        floor: relative model error that it leaves.
    """

    joint: JointDirection
    family: LawFamily
    theta: tuple[float, ...]
    parallel: Real
    cost: float
    floor: float


def fit_starts(
    scene: Scene,
    joint: JointDirection,
    effects: Sequence[str],
    stiffest: float,
    least_damping: float,
) -> list[LawStart]:
    """Return the best start of each effect.

    Args:
        scene: linear machine at the lowest level.
        joint: direction of the joint.
        effects: the effects.
        stiffest: largest stiffness of the joint at any level.
        least_damping: least damping at any level.
    """
    alone = _LawFit.of_scene(scene, joint, stiffest)
    return [_fit_effect(alone, effect, least_damping) for effect in effects]


@dataclass(frozen=True, eq=False)
class _TriedLaw:
    """A law with its residuals.

    Args:
        family: of the law.
        values: its parameters, without that of the joint's stiffness, then stiffness and damping of
            the joint in parallel with it; (n_value,).
        residuals: of all values; (n_value,).
        error: model error that they show.
    """

    family: LawFamily
    values: Real
    residuals: Complex
    error: ModelError


@dataclass(frozen=True, eq=False)
class _LawFit:
    """A fit of one joint's law, the rest of the machine held.

    Args:
        joint: direction of the joint.
        tested: machine and hits.
        update: FRFs as the joint's stiffness changes.
        stiffest: largest stiffness of the joint at any level.
        middle_stretch: largest stretch of the linear machine under hits of the middle level.
        largest_stretch: under any hit.
    """

    joint: JointDirection
    tested: TestedJoint
    update: JointUpdate
    stiffest: float
    middle_stretch: float
    largest_stretch: float

    @classmethod
    def of_scene(cls, scene: Scene, joint: JointDirection, stiffest: float) -> "_LawFit":
        campaign = scene.session.campaign
        thin = thin_lines(campaign, LEVEL_SETTINGS.start_stride * scene.stride_factor)
        tested = replace(
            TestedJoint.of_scene(scene, joint),
            steps_per_period=LEVEL_SETTINGS.start_steps_per_period,
        )
        levels = list_levels(campaign)
        peaks = compute_peak_stretch(tested.transient(), tested.hits)
        is_low = np.abs(tested.hits.peak) <= levels[len(levels) // 2]
        update = JointUpdate.of_scene(scene, joint, tested, thin)
        return cls(joint, tested, update, stiffest, float(peaks[is_low].max()), float(peaks.max()))

    def list_starts(self, family: LawFamily, least_damping: float) -> list[Real]:
        """Return where a family may begin: any level's least damping, and the lowest level's."""
        stiffness = self.tested.stiffness if family.softest_is_linear else self.stiffest
        starts = []
        for theta in family.starts(stiffness, self.middle_stretch):
            parameters = np.array(theta[: family.count])
            stiff = stiffness - family.stuck(parameters)
            for damping in (least_damping, self.tested.damping):
                values = np.array([*parameters, stiff, damping])
                starts.append(self.limit(family, values))
        return starts

    def evaluate(self, tried: Sequence[tuple[LawFamily, Real]]) -> list[_TriedLaw | None]:
        """Return laws with their residuals; None for one whose motion grows without bound."""
        points: list[_TriedLaw | None] = []
        for (family, values), kappa in zip(tried, self._add(tried), strict=True):
            residuals = self.update.residuals(kappa)
            if np.isfinite(residuals).all():
                error = self.update.estimate_error(residuals)
                points.append(_TriedLaw(family, values, residuals, error))
            else:
                points.append(None)
        return points

    def limit(self, family: LawFamily, values: Real) -> Real:
        """Return values within the bounds of a family; spring near any level's, damper near it."""
        bounds = family.bounds(self.tested.stiffness, self.largest_stretch)[: family.count]
        share = LEVEL_SETTINGS.min_own_share
        spring = share * self.tested.stiffness, self.stiffest / share
        damper = share * self.tested.damping, self.tested.damping / share
        lower, upper = np.array([*bounds, spring, damper]).T
        limited: Real = np.clip(values, lower, upper)
        return limited

    def _add(self, tried: Sequence[tuple[LawFamily, Real]]) -> Complex:
        """Return the complex stiffness that laws add; (n_law, n_test, n_freq)."""
        laws = [
            (family, family.complete(values[:-2], float(values[-2])), values[-2:])
            for family, values in tried
        ]
        return self.tested.add_laws(laws, self.update.freq_hz)


def _fit_effect(alone: _LawFit, effect: str, least_damping: float) -> LawStart:
    """Return the best law of an effect, its best families fitted."""
    best = []
    for family in FAMILIES[effect]:
        starts = [(family, v) for v in alone.list_starts(family, least_damping)]
        best += sorted(filter(None, alone.evaluate(starts)), key=lambda point: point.error.cost)[:1]
    if not best:
        raise ValueError(f"{effect} has no law that holds")
    best = sorted(best, key=lambda point: point.error.cost)[: LEVEL_SETTINGS.fitted_families]
    point = min(_fit_points(alone, best), key=lambda point: point.error.cost)
    theta = point.family.complete(point.values[:-2], float(point.values[-2]))
    return LawStart(
        alone.joint,
        point.family,
        tuple(theta.tolist()),
        point.values[-2:],
        cost=point.error.cost / point.error.values,
        floor=point.error.floor,
    )


def _fit_points(alone: _LawFit, points: list[_TriedLaw]) -> list[_TriedLaw]:
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


def _list_moves(point: _TriedLaw) -> list[Real]:
    """Return the values of a law with one coordinate moved each."""
    steps = LEVEL_SETTINGS.difference_step * np.eye(len(point.values))
    return [_move(point, step) for step in steps]


def _move(point: _TriedLaw, step: Real) -> Real:
    """Return the values of a law after a step of its coordinates: logarithms of sizes."""
    is_size = _list_sizes(point)
    limited = np.clip(step, -LEVEL_SETTINGS.largest_start_step, LEVEL_SETTINGS.largest_start_step)
    moved: Real = np.where(is_size, point.values * np.exp(limited), point.values + limited)
    return moved


def _list_sizes(point: _TriedLaw) -> Real:
    """Return which values are positive sizes, as the joint's stiffness and damping are."""
    return np.array([*point.family.is_size[: point.family.count], True, True])


def _find_slope(point: _TriedLaw, moved: _TriedLaw | None) -> Complex:
    """Return the derivative of the residuals by a coordinate; zero where the motion diverges."""
    if moved is None:
        return np.zeros_like(point.residuals)
    slope: Complex = (moved.residuals - point.residuals) / LEVEL_SETTINGS.difference_step
    return slope


def _solve_step(slopes: Complex, point: _TriedLaw, weights: Real, damping: float) -> Real:
    """Return the damped Gauss-Newton step; slopes (n_coordinate, n_value)."""
    normal = ((slopes.conj() * weights) @ slopes.T).real
    gradient = ((slopes.conj() * weights) @ point.residuals).real
    scale = np.sqrt(np.maximum(np.diag(normal), np.finfo(float).tiny))
    unit = normal / np.outer(scale, scale) + damping * np.eye(len(scale))
    step: Real = -np.linalg.solve(unit, gradient / scale) / scale
    return step
