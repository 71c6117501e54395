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
3. The law is fitted with everything that varies (``fitted_law``). The number of turns, and with it
   that of simulations, is bounded.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from diagnosis.hypothesis import Hypothesis, JointDirection, Scene
from diagnosis.levels.fitted_law import FittedLaw, LawPoint, read_values
from diagnosis.levels.free_levels import free_each_level, list_levels
from diagnosis.levels.law_alone import LawStart
from diagnosis.levels.law_starts import fit_starts
from diagnosis.levels.law_table import LawTable
from diagnosis.levels.settings import LEVEL_SETTINGS
from diagnosis.refits.refit import Refit, map_values
from diagnosis.refits.refitting import add_cause, run_refits
from diagnosis.scene_points import find_middle_frequency
from diagnosis.settings import DiagnosisSettings
from identification.words import Complex
from mbmodel import AddedPart
from tuning import is_gap_visible
from tuning.workers.independent_calls import run_in_parallel


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
    nearby = replace(about, theta=read_values(free[joint], about))
    effects = list(dict.fromkeys(h.effect for h in hypotheses if h.spring == joint))
    starts = _find_starts(nearby, free[joint], joint, effects)
    best = min((rival.summary.cost for rival in rivals), default=np.inf)
    cost = current.summary.cost
    gain = cost - min(free[joint].summary.cost, *(start.cost for start in starts))
    if gain < LEVEL_SETTINGS.min_gain_share * (cost - best):
        return []
    laws = [FittedLaw(LawPoint(start, nearby)) for start in starts]
    schedule = replace(settings.schedule, max_turns=1, max_steps=LEVEL_SETTINGS.steps_per_turn)
    counted = schedule.thin(len(scene.session.campaign.freq_hz), scene.stride_factor).stride // 2
    for turn in range(LEVEL_SETTINGS.max_turns):
        working = _select_working(laws, turn)
        plans = [law.point.plan() for law in working]
        tables = run_in_parallel([(LawTable.simulate, plan) for plan in plans], scene.jobs)
        for law, table in zip(working, tables, strict=True):
            law.linearise(current, table, counted)
        working = [law for law in working if law.task is not None]
        tasks = [law.task for law in working if law.task is not None]
        for law, refit in zip(working, run_refits(scene, tasks, schedule), strict=True):
            law.take(refit, about)
    return [law.refit for law in laws if law.refit is not None]


def _select_working(laws: Sequence[FittedLaw], turn: int) -> list[FittedLaw]:
    """Return the laws that a further turn may bring to the front."""
    is_late = turn > LEVEL_SETTINGS.max_turns // 3
    behind = LEVEL_SETTINGS.max_behind_nats if is_late else LEVEL_SETTINGS.max_start_behind_nats
    most = min(law.objective for law in laws) + behind
    return [law for law in laws if not law.is_settled and (turn < 2 or law.objective <= most)]


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
