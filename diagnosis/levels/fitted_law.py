"""A law between its refits: a Gauss-Newton search with a trust region.

Each turn simulates the law once, about the machine and at the parameters where the refit before
ended, and refits all with the law linear there (``law_table``). Where the law explains the FRFs
better than at the best point before, the next turn begins there. Otherwise it begins at the best
point again, in a smaller region (Nocedal and Wright 2006, ch. 4). A point counts by the law as it
was simulated there, never by a linear one.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from diagnosis.hypothesis import JointDirection, Scene
from diagnosis.levels.law_alone import LawStart
from diagnosis.levels.law_family import LawFamily
from diagnosis.levels.law_hypothesis import LawPart, build_law_hypothesis, plan_simulation
from diagnosis.levels.law_table import LawTable
from diagnosis.levels.settings import LEVEL_SETTINGS
from diagnosis.levels.tested_joint import TestedJoint
from diagnosis.refits.refit import Refit, map_values
from diagnosis.refits.refitting import (
    RefitTask,
    add_hypotheses,
    estimate_start_error,
    find_start,
)
from identification.words import Real

_PARALLEL = ("stiffness", "damping")  # parameters of a joint in parallel with its law


@dataclass(frozen=True, eq=False)
class LawPoint:
    """Where a law is simulated.

    Args:
        start: its parameters.
        scene: linear machine about which it is simulated.
        hits: fitted tolerances of the hits, by their names.
        prior: part of the objective that the priors make there [nats per value].
    """

    start: LawStart
    scene: Scene
    hits: Mapping[str, float] = field(default_factory=dict)
    prior: float = 0.0

    def plan(self) -> tuple[TestedJoint, LawFamily, tuple[float, ...], tuple[str, ...]]:
        """Return the arguments of the simulation there."""
        start = self.start
        return plan_simulation(self.moved, start.joint, start.family, start.theta, self.hits)

    @property
    def moved(self) -> Scene:
        """Scene with the joint's spring and damper of the start."""
        start, scene = self.start, self.scene
        names = [parameter.name for parameter in scene.model.parameters]
        theta = scene.theta.copy()
        for kind, value in zip(_PARALLEL, start.parallel, strict=True):
            if f"{start.joint.spring}.{kind}" in names:
                theta[names.index(f"{start.joint.spring}.{kind}")] = value
        return replace(scene, theta=theta)


@dataclass(eq=False)
class FittedLaw:
    """A law between its refits.

    Args:
        point: where it is simulated next.
        best: the best point so far, and the law as it was simulated there.
        objective: of the simulated law there [nats per value].
        radius: of the trust region: largest change of a coordinate in a turn.
        task: refit with the law linear about the best point.
        refit: its result.
        is_settled: whether a further turn would change nothing.
    """

    point: LawPoint
    best: tuple[LawPoint, LawTable] | None = None
    objective: float = np.inf
    radius: float = LEVEL_SETTINGS.first_radius
    task: RefitTask | None = None
    refit: Refit | None = None
    is_settled: bool = False

    def linearise(self, current: Refit, table: LawTable, stride: int) -> None:
        """Take a simulated law, or a smaller region about the best one if it explains less.

        Args:
            current: refit beside which the law is fitted.
            table: law at the point.
            stride: step between the frequency lines that count.
        """
        task = _build_task(current, self.point, table, self.radius)
        error = estimate_start_error(task, stride)
        objective = np.inf if error is None else error.cost / error.values + self.point.prior
        if error is not None and objective < self.objective:
            if self.refit is not None:
                kept = (self.objective - objective) / (self.objective - self.refit.objective)
                self.radius *= 2.0 if kept > 0.5 else 1.0
                self.radius = min(self.radius, LEVEL_SETTINGS.largest_start_step)
                task = _build_task(current, self.point, table, self.radius)
            self.best, self.objective = (self.point, table), objective
            self.task = replace(task, floor=error.floor)
        elif self.best is not None and self.task is not None:
            self.radius /= 4
            self.is_settled = self.radius < LEVEL_SETTINGS.difference_step
            task = _build_task(current, *self.best, self.radius)
            self.task = replace(task, floor=self.task.floor)
        else:
            self.is_settled = True

    def take(self, refit: Refit, about: Scene) -> None:
        """Take a refit, which says where the law is simulated next."""
        gain = self.objective - refit.objective
        self.is_settled = self.is_settled or gain < LEVEL_SETTINGS.converged_nats
        self.refit = refit
        fitted = map_values(refit.fit.parametrisation, refit.fit.theta)
        self.point = LawPoint(
            _read_start(refit, self.point.start),
            replace(about, theta=read_values(refit, about)),
            {name: fitted[name] for name in refit.causes[-1].believed},
            refit.objective - refit.summary.cost,
        )


def _build_task(current: Refit, point: LawPoint, table: LawTable, radius: float) -> RefitTask:
    """Return the refit with a law that is linear about a point."""
    start, scene = point.start, point.moved
    law = build_law_hypothesis(
        scene, start.joint, start.family, start.theta, point.hits, table=table, radius=radius
    )
    session = add_hypotheses(current.session, law)
    causes = (*current.causes, law)
    return RefitTask(causes, session, find_start(scene, session, law), start.floor)


def read_values(refit: Refit, scene: Scene) -> Real:
    """Return what a refit fitted of a scene's own parameters; (n_parameter,)."""
    fitted = map_values(refit.fit.parametrisation, refit.fit.theta)
    return np.array([fitted[parameter.name] for parameter in scene.model.parameters])


def _read_start(refit: Refit, start: LawStart) -> LawStart:
    """Return a law that begins where its refit ended."""
    fitted = map_values(refit.fit.parametrisation, refit.fit.theta)
    prefix = f"{start.joint.spring}.{start.family.effect}"
    theta = tuple(fitted[f"{prefix}.{name}"] for name, _ in start.family.parameters)
    parallel = [
        fitted.get(f"{start.joint.spring}.{kind}", value)
        for kind, value in zip(_PARALLEL, start.parallel, strict=True)
    ]
    return replace(start, theta=theta, parallel=np.array(parallel))


def renew_laws(scene: Scene, refit: Refit) -> RefitTask:
    """Return a further refit of a set, its laws simulated about the machine that it fitted.

    Args:
        scene: where no cause is corrected or added.
        refit: set of causes on all tests.
    """
    fitted, causes = map_values(refit.fit.parametrisation, refit.fit.theta), list(refit.causes)
    for number, cause in enumerate(refit.causes):
        part = next((part for part in cause.parts if isinstance(part, LawPart)), None)
        beside = [each for each in causes if each is not causes[number]]
        if part is None or cause.dof is None:
            continue
        about = replace(scene, session=add_hypotheses(scene.session, *beside))
        family = part.table.family
        causes[number] = build_law_hypothesis(
            replace(about, theta=read_values(refit, about)),
            JointDirection(cause.location.removeprefix("joint:"), cause.dof, part.spring),
            family,
            tuple(fitted[f"{part.spring}.{family.effect}.{name}"] for name, _ in family.parameters),
            {name: fitted[name] for name in cause.believed},
        )
    session = add_hypotheses(scene.session, *causes)
    return RefitTask(tuple(causes), session, find_start(refit, session), refit.floor)
