"""Refits of restoring laws: where they begin, and the machine about which they are simulated.

1. The joint direction is refitted with a stiffness and damping of its own at each level.
2. Each law begins at the parameters whose simulated stiffness changes from level to level most
   like that (means over lines and references, weighted by the stretch).
3. The law is refitted. A refit moves the linear machine about which the law was simulated, so the
   law is built again about each refit, until the objective moves no more.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.effects.points import find_middle_frequency
from diagnosis.hypothesis import Hypothesis, JointDirection, Scene
from diagnosis.hypothesis_set import join_hypotheses
from diagnosis.levels.free_levels import free_each_level, list_levels
from diagnosis.levels.hammer_pulse import compute_pulse_spectrum
from diagnosis.levels.law_family import FAMILIES, LawFamily
from diagnosis.levels.law_hypothesis import build_law_hypothesis
from diagnosis.levels.law_simulation import (
    LawUnderHits,
    compute_equivalent_stiffness,
    compute_peak_stretch,
)
from diagnosis.levels.settings import LEVEL_SETTINGS
from diagnosis.levels.tested_joint import TestedJoint
from diagnosis.refits.refit import Refit
from diagnosis.refits.refitting import (
    RefitTask,
    add_cause,
    add_hypothesis,
    find_start,
    run_refits,
)
from diagnosis.settings import DiagnosisSettings
from identification.words import Complex, Real
from mbmodel import AddedPart
from tuning import is_gap_visible


@dataclass(frozen=True, eq=False)
class _LawStart:
    """A law, and where its refit begins.

    Args:
        joint: direction of the joint.
        family: of the law.
        theta: its parameters.
        stiffness: of the joint's spring beside it.
    """

    joint: JointDirection
    family: LawFamily
    theta: tuple[float, ...]
    stiffness: float


def refit_laws(
    scene: Scene,
    current: Refit,
    hypotheses: Sequence[Hypothesis],
    null_gap: float,
    rivals: Sequence[Refit],
    settings: DiagnosisSettings,
) -> list[Refit]:
    """Refit the laws of joint directions that depend on the level, beside the causes there are.

    Args:
        scene: scene of the null model.
        current: refit from which they begin.
        hypotheses: scored hypotheses of ``free_each_level``.
        null_gap: of the null model: free levels that do not close a fifth of it need no law.
        rivals: refits of linear causes: no law is simulated whose free levels are far behind.
        settings: schedules, and that fifth.

    Returns:
        One refit for each effect, at the direction whose free levels explain most.
    """
    about = replace(scene, session=current.session, theta=current.fit.theta)
    joints = list(dict.fromkeys(h.spring for h in hypotheses if h.spring is not None))
    if not joints or not is_gap_visible(current.gap):
        return []
    tasks = [add_cause(current, free_each_level(about, joint, "level")) for joint in joints]
    free = dict(zip(joints, run_refits(scene, tasks, settings.schedule), strict=True))
    joint = min(joints, key=lambda joint: free[joint].objective)
    if current.gap - free[joint].gap < settings.min_closed * null_gap:
        return []
    best = min((rival.objective for rival in rivals), default=np.inf)
    gain = current.objective - free[joint].objective
    if gain < LEVEL_SETTINGS.min_gain_share * (current.objective - best):
        return []
    nearby = replace(about, theta=_read_values(free[joint], about))
    laws = [
        _FittedLaw(_find_start(nearby, free[joint], joint, effect), nearby, free[joint].floor)
        for effect in dict.fromkeys(h.effect for h in hypotheses if h.spring == joint)
    ]
    for turn in range(LEVEL_SETTINGS.max_turns):
        working = [law for law in laws if not law.is_settled]
        if turn:
            best = min(law.objective for law in laws)
            working = [
                law for law in working if law.objective < best + LEVEL_SETTINGS.max_behind_nats
            ]
        tasks = [_build_task(current, law) for law in working]
        for law, refit in zip(working, run_refits(scene, tasks, settings.schedule), strict=True):
            law.take(refit, about)
    return [law.refit for law in laws if law.refit is not None]


@dataclass(eq=False)
class _FittedLaw:
    """A law between its refits.

    Args:
        start: where its next refit begins.
        scene: linear machine about which it is simulated.
        floor: relative model error.
        refit: the best one so far.
        is_settled: whether a further refit would change nothing.
    """

    start: _LawStart
    scene: Scene
    floor: float
    refit: Refit | None = None
    is_settled: bool = False

    @property
    def objective(self) -> float:
        """Objective of the best refit [nats per value]."""
        return np.inf if self.refit is None else self.refit.objective

    def take(self, refit: Refit, about: Scene) -> None:
        """Keep a refit if it is better, and begin the next one where it ended."""
        self.is_settled = self.objective - refit.objective < LEVEL_SETTINGS.settled_nats
        if refit.objective < self.objective:
            self.refit = refit
        self.scene = replace(about, theta=_read_values(refit, about))
        self.start, self.floor = _read_start(refit, self.start), refit.floor


def _build_task(current: Refit, fitted: _FittedLaw) -> RefitTask:
    """Return the next refit of a law."""
    start, scene = fitted.start, fitted.scene
    spring = f"{start.joint.spring}.stiffness"
    names = [parameter.name for parameter in scene.model.parameters]
    theta = scene.theta.copy()
    theta[names.index(spring)] = start.stiffness
    scene = replace(scene, theta=theta)
    law = build_law_hypothesis(scene, start.joint, start.family, start.theta)
    session = add_hypothesis(current.session, law)
    causes = join_hypotheses((*current.causes, law))
    return RefitTask(causes, session, find_start(scene, session, law), fitted.floor)


def _read_values(refit: Refit, scene: Scene) -> Real:
    """Return what a refit fitted of a scene's own parameters; (n_parameter,)."""
    parameters = refit.session.model.parameters
    fitted = dict(zip((p.name for p in parameters), refit.fit.theta.tolist(), strict=True))
    return np.array([fitted[parameter.name] for parameter in scene.model.parameters])


def _read_start(refit: Refit, start: _LawStart) -> _LawStart:
    """Return a law that begins where its refit ended."""
    parameters = refit.session.model.parameters
    fitted = dict(zip((p.name for p in parameters), refit.fit.theta.tolist(), strict=True))
    prefix = f"{start.joint.spring}.{start.family.effect}"
    theta = tuple(fitted[f"{prefix}.{name}"] for name, _ in start.family.parameters)
    return replace(start, theta=theta, stiffness=fitted[f"{start.joint.spring}.stiffness"])


def _find_start(scene: Scene, free: Refit, joint: JointDirection, effect: str) -> _LawStart:
    """Return the law of an effect whose stiffness changes most like what is free at each level.

    Args:
        scene: linear machine at the lowest level.
        free: refit with free levels.
        joint: direction of the joint.
        effect: the effect.
    """
    levels = list_levels(scene.session.campaign)
    changes = _read_changes(free, joint, len(levels))
    lowest = float(scene.find_stiffness((joint.spring,))[0])
    tested = TestedJoint.of_scene(scene, joint)
    best: tuple[float, _LawStart] | None = None
    for family in FAMILIES[effect]:
        reference = 0.0 if family.softest_is_linear else float(changes.real.max())
        added = reference * np.outer(tested.direction, tested.direction)
        linear = replace(tested.matrices, stiffness=tested.matrices.stiffness + added)
        machine = replace(tested, matrices=linear)
        transient = machine.transient()
        peaks = compute_peak_stretch(transient, tested.hits)
        middle = float(np.max(peaks[np.abs(tested.hits.peak) <= levels[len(levels) // 2]]))
        weights = _weigh_stretch(machine, transient.receptances(machine.freq_hz))
        starts = family.starts(lowest + reference, middle)
        laws = [LawUnderHits(transient, family.law(np.array(s)), machine.hits) for s in starts]
        kappas = compute_equivalent_stiffness(laws, machine.freq_hz)
        for theta, kappa in zip(starts, kappas, strict=True):
            means = family.stuck(np.array(theta)) + _average_levels(
                kappa, weights, tested.hits.peak, levels, machine.freq_hz
            )
            off = float(np.sum(np.abs(means - means[0] - changes) ** 2))
            if best is None or off < best[0]:
                beside = max(lowest - float(means[0].real), LEVEL_SETTINGS.min_own_share * lowest)
                best = off, _LawStart(joint, family, theta, beside)
    if best is None:
        raise ValueError(f"{effect} has no law")
    return best[1]


def _read_changes(free: Refit, joint: JointDirection, count: int) -> Complex:
    """Return dk_l + i w dc_l at the middle of the band; (n_level,)."""
    middle = find_middle_frequency(Scene(free.session, free.fit.theta))
    parts = {
        part.parameters[0].name: part
        for part in free.session.model.parts
        if isinstance(part, AddedPart)
    }
    parameters = free.session.model.parameters
    fitted = dict(zip((p.name for p in parameters), free.fit.theta.tolist(), strict=True))
    changes = np.zeros(count, complex)
    for number in range(1, count):
        prefix = f"{joint.spring}.level.level{number}"
        (change,) = parts[f"{prefix}.stiffness"].finite(
            np.array([fitted[f"{prefix}.stiffness"], fitted[f"{prefix}.damping"]])
        )
        changes[number] = change.core[0, 0, 0] + 1j * middle * change.core[1, 0, 0]
    return changes


def _weigh_stretch(joint: TestedJoint, receptances: Complex) -> Real:
    """Return the squared stretch of the linear machine on each line; (n_test, n_freq)."""
    force = compute_pulse_spectrum(joint.freq_hz, joint.hits.duration_s)
    weights: Real = np.abs(receptances.T[1 + joint.hits.column] * force) ** 2
    return weights * joint.hits.peak[:, None] ** 2


def _average_levels(
    kappa: Complex, weights: Real, peak: Real, levels: Sequence[float], freq_hz: Real
) -> Complex:
    """Return the mean stiffness of each level, its imaginary part per frequency; (n_level,)."""
    middle = np.sqrt(freq_hz.min() * freq_hz[-1])
    scaled = kappa.real + 1j * kappa.imag * middle / freq_hz
    means = []
    for level in levels:
        rows = np.isclose(np.abs(peak), level)
        means.append((scaled[rows] * weights[rows]).sum() / weights[rows].sum())
    return np.array(means)
