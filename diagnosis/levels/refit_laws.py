"""Refits of restoring laws: where they begin, and the machine about which they are simulated.

Laws explain what depends on the level (``level_dependence``). Beside causes that are selected
already, laws are refitted while a fifth of the null model's dependence remains.

1. The joint direction is refitted with a stiffness and damping of its own at each level.
2. Each law is fitted with the rest of that machine held (``law_starts``). A law that is far behind
   the best one goes no further, unless it is a loose gap. Free levels, and laws with the rest held,
   tell where a law acts, but not how much it explains once all varies.
   The joint's damper then begins at its nominal value: where resonances of the machine that is
   held lie beside the measured ones, a fit damps them until they vanish. A refit that began there
   ended in a minimum with 2.5 times the damping and two thirds of the gap.
3. The law is refitted with everything that varies. A refit moves the linear machine about which the
   law was simulated, so the law is built again about each refit, until the objective moves no more
   or was refitted once with no visible gap left. Each refit begins where the one before ended, with
   the hits as it fitted them. The first one, about the machine with free levels, only leads to the
   second: its law is that of a machine which the refit has left. Laws are therefore compared after
   the second one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from diagnosis.hypothesis import Hypothesis, JointDirection, Scene
from diagnosis.hypothesis_set import join_hypotheses
from diagnosis.levels.free_levels import free_each_level, list_levels
from diagnosis.levels.law_alone import LawStart
from diagnosis.levels.law_hypothesis import build_law_hypothesis
from diagnosis.levels.law_starts import fit_starts
from diagnosis.levels.settings import LEVEL_SETTINGS
from diagnosis.refits.refit import Refit, map_values
from diagnosis.refits.refitting import (
    RefitTask,
    add_cause,
    add_hypothesis,
    find_start,
    run_refits,
)
from diagnosis.scene_points import find_middle_frequency
from diagnosis.settings import DiagnosisSettings
from identification.words import Complex, Real
from mbmodel import AddedPart
from tuning import is_gap_visible

_PARALLEL = ("stiffness", "damping")  # parameters of a joint in parallel with its law


def refit_laws(
    scene: Scene,
    null: Refit,
    current: Refit,
    hypotheses: Sequence[Hypothesis],
    rivals: Sequence[Refit],
    settings: DiagnosisSettings,
) -> list[Refit]:
    """Refit the laws of joint directions that depend on the level, beside the causes there are.

    Args:
        current: refit from which they begin.
        hypotheses: scored hypotheses of ``free_each_level``.
        rivals: refits of linear causes: no law is refitted if they gain far more.
        settings: schedules, and the part of what depends on the level that a further law must find.

    Returns:
        One refit for each effect, at the direction whose free levels explain most.
    """
    about = replace(scene, session=current.session, theta=current.fit.theta)
    joints = list(dict.fromkeys(h.spring for h in hypotheses if h.spring is not None))
    if not joints or not is_gap_visible(current.gap):
        return []
    first, remaining = null.summary.level_excess, current.summary.level_excess
    if first is not None and remaining is not None and remaining < settings.min_closed * first:
        return []
    tasks = [add_cause(current, free_each_level(about, joint, "level")) for joint in joints]
    free = dict(zip(joints, run_refits(scene, tasks, settings.schedule), strict=True))
    joint = min(joints, key=lambda joint: free[joint].objective)
    nearby = replace(about, theta=_read_values(free[joint], about))
    effects = list(dict.fromkeys(h.effect for h in hypotheses if h.spring == joint))
    starts = _find_starts(nearby, free[joint], joint, effects)
    best = min((rival.summary.cost for rival in rivals), default=np.inf)
    cost = current.summary.cost
    gain = cost - min(free[joint].summary.cost, *(start.cost for start in starts))
    if gain < LEVEL_SETTINGS.min_gain_share * (cost - best):
        return []
    laws = [_FittedLaw(start, nearby, start.floor) for start in starts]
    schedule = replace(settings.schedule, max_turns=LEVEL_SETTINGS.fits_per_turn)
    for turn in range(LEVEL_SETTINGS.max_turns):
        working = [law for law in laws if not law.is_settled]
        best = min(law.objective for law in laws)
        if turn == 1:
            most = best + LEVEL_SETTINGS.max_start_behind_nats
            working = [law for law in working if not law.start.is_loose or law.objective < most]
        if turn > 1:
            most = best + LEVEL_SETTINGS.max_behind_nats
            working = [law for law in working if law.objective < most]
        if not working:
            break
        tasks = [_build_task(current, law) for law in working]
        for law, refit in zip(working, run_refits(scene, tasks, schedule), strict=True):
            law.take(refit, about)
    return [law.refit for law in laws if law.refit is not None]


@dataclass(eq=False)
class _FittedLaw:
    """A law between its refits.

    Args:
        start: where its next refit begins.
        scene: linear machine about which it is simulated.
        floor: relative model error.
        hits: fitted tolerances of the hits, by their names.
        refit: the best one so far.
        count: number of refits so far.
        was_worse: whether the last refit ended higher than the best one. The machine had moved:
            one more refit shows whether the objective falls again.
        is_settled: whether a further refit would change nothing.
    """

    start: LawStart
    scene: Scene
    floor: float
    hits: dict[str, float] = field(default_factory=dict)
    refit: Refit | None = None
    count: int = 0
    was_worse: bool = False
    is_settled: bool = False

    @property
    def objective(self) -> float:
        """Objective of the best refit [nats per value]."""
        return np.inf if self.refit is None else self.refit.objective

    def take(self, refit: Refit, about: Scene) -> None:
        """Keep a refit if it is better or the second, and begin the next one where it ended."""
        gain = self.objective - refit.objective
        had_gap = self.refit is None or is_gap_visible(self.refit.gap)
        self.count += 1
        is_worse = gain < -LEVEL_SETTINGS.settled_nats
        is_unchanged = gain < LEVEL_SETTINGS.settled_nats and (self.was_worse or not is_worse)
        self.is_settled = (is_unchanged and self.count > 2) or not had_gap
        self.was_worse = is_worse
        if self.count == 2 or gain > 0:
            self.refit = refit
        self.scene = replace(about, theta=_read_values(refit, about))
        self.start, self.floor = _read_start(refit, self.start), refit.floor
        fitted = map_values(refit.fit.parametrisation, refit.fit.theta)
        self.hits = {name: fitted[name] for name in refit.causes[-1].believed}


def _build_task(current: Refit, fitted: _FittedLaw) -> RefitTask:
    """Return the next refit of a law."""
    start, scene = fitted.start, fitted.scene
    names = [parameter.name for parameter in scene.model.parameters]
    theta = scene.theta.copy()
    for kind, value in zip(_PARALLEL, start.parallel, strict=True):
        if f"{start.joint.spring}.{kind}" in names:
            theta[names.index(f"{start.joint.spring}.{kind}")] = value
    scene = replace(scene, theta=theta)
    law = build_law_hypothesis(scene, start.joint, start.family, start.theta, fitted.hits)
    session = add_hypothesis(current.session, law)
    causes = join_hypotheses((*current.causes, law))
    return RefitTask(causes, session, find_start(scene, session, law), fitted.floor)


def _read_values(refit: Refit, scene: Scene) -> Real:
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


def _find_starts(
    scene: Scene, free: Refit, joint: JointDirection, effects: Sequence[str]
) -> list[LawStart]:
    """Return a start of each effect that may explain the FRFs as well as the best one.

    It has the stiffness that was fitted with the law, and the nominal damper.

    Args:
        free: refit with free levels.
    """
    changes = _read_changes(free, joint, len(list_levels(scene.session.campaign)))
    stiffness = float(scene.find_stiffness((joint.spring,))[0])
    damping = float(scene.find_damping((joint.spring,))[0])
    middle = find_middle_frequency(Scene(free.session, free.fit.theta))
    stiffest = stiffness + float(changes.real.max())
    least_damping = damping + float(changes.imag.min()) / middle
    starts = fit_starts(scene, joint, effects, stiffest, least_damping)
    best = min(start.cost for start in starts)
    nominal = replace(scene, theta=scene.session.parametrisation.fixed).find_damping(
        (joint.spring,)
    )
    return [
        replace(start, parallel=np.append(start.parallel[:1], nominal))
        for start in starts
        if start.is_loose or start.cost < best + LEVEL_SETTINGS.max_start_behind_nats
    ]


def _read_changes(free: Refit, joint: JointDirection, count: int) -> Complex:
    """Return dk_l + i w dc_l at the middle of the band; (n_level,)."""
    middle = find_middle_frequency(Scene(free.session, free.fit.theta))
    parts = {
        part.parameters[0].name: part
        for part in free.session.model.parts
        if isinstance(part, AddedPart)
    }
    fitted = map_values(free.fit.parametrisation, free.fit.theta)
    changes = np.zeros(count, complex)
    for number in range(1, count):
        prefix = f"{joint.spring}.level.level{number}"
        (change,) = parts[f"{prefix}.stiffness"].finite(
            np.array([fitted[f"{prefix}.stiffness"], fitted[f"{prefix}.damping"]])
        )
        changes[number] = change.core[0, 0, 0] + 1j * middle * change.core[1, 0, 0]
    return changes
