"""Search for a further cause beside a law: on the tests of one level, with the law held.

Beside a law each level and hammer point has a machine of its own, and with three levels a step of a
fit takes four times as long. A cause that acts in every test is in those of one level too. So
rivals are first fitted to the highest level, where the noise is least, with the law as it was
fitted. The best one, and those that a verdict would list, are then refitted with the law on all
levels.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.inference.calibration import find_variance_source, load_calibration
from diagnosis.inference.evidence import Evidence, Key
from diagnosis.inference.posterior import compute_log_odds
from diagnosis.levels.fitted_law import renew_laws
from diagnosis.levels.free_levels import list_levels
from diagnosis.levels.law_hypothesis import LawPart
from diagnosis.refits.extended_parametrisation import hold_parameters
from diagnosis.refits.refit import Refit
from diagnosis.refits.refitting import (
    RefitTask,
    add_cause,
    add_hypotheses,
    find_start,
    run_refits,
)
from diagnosis.settings import DiagnosisSettings
from mbmodel import Model
from tuning import Stage

Trial = tuple[Hypothesis, tuple[Stage, ...]]  # a further cause, and the first stages of its refit


@dataclass(frozen=True, eq=False)
class CauseSearch:
    """Refits of a set of causes with one more.

    Args:
        scene: scene of the null model.
        current: the set.
        seen: the set as its rivals are fitted first: itself, or beside a law on one level.
        settings: schedules, and what is material.
    """

    scene: Scene
    current: Refit
    seen: Refit
    settings: DiagnosisSettings

    @classmethod
    def beside(cls, scene: Scene, current: Refit, settings: DiagnosisSettings) -> "CauseSearch":
        """Return the search for one more cause beside a set."""
        if not has_law(current):
            return cls(scene, current, current, settings)
        task = RefitTask(current.causes, current.session, current.fit.theta, current.floor)
        (seen,) = run_refits(scene, [hold_law(task)], settings.schedule)
        return cls(scene, current, seen, settings)

    @property
    def is_on_one_level(self) -> bool:
        """Whether rivals are fitted to one level first."""
        return self.seen is not self.current

    def shows(self, hypothesis: Hypothesis) -> bool:
        """Return whether the tests that are fitted first are enough for a hypothesis.

        One level does not show what acts in some tests only, as drift between levels does.
        """
        machine = self.scene.model.machine
        return not self.is_on_one_level or all(
            Model(machine, hypothesis.parts).acting_fractions(None)
        )

    def refit(self, trials: Sequence[Trial]) -> list[Refit]:
        """Return a refit with each further cause that the tests show, beside a law on one level.

        Those do not count that end where another effect begins.
        """
        tasks = [
            add_cause(self.seen, hypothesis, stages)
            for hypothesis, stages in trials
            if self.shows(hypothesis)
        ]
        refits = run_refits(self.scene, tasks, self.settings.schedule)
        return [refit for refit in refits if not refit.shows_another_effect]

    def finish(
        self,
        refits: Sequence[Refit],
        trials: Sequence[Trial],
        hypotheses: int,
        small_faults: tuple[Key, ...],
    ) -> list[Refit]:
        """Return the refits on all levels of the best rivals, and of those one level hides.

        The best one is refitted once more, with the law simulated about its machine.

        Args:
            refits: on one level.
            trials: all further causes.
            hypotheses: number of effects and places that were scored.
        """
        tasks = []
        for refit in select_listed(self.seen, refits, hypotheses, small_faults, self.settings):
            session = add_hypotheses(self.current.session, refit.causes[-1])
            start = find_start(refit, session)
            tasks.append(RefitTask(refit.causes, session, start, refit.floor))
        tasks += [
            add_cause(self.current, hypothesis, stages)
            for hypothesis, stages in trials
            if not self.shows(hypothesis)
        ]
        on_all = run_refits(self.scene, tasks, self.settings.schedule)
        if not on_all:
            return []
        best = min(on_all, key=lambda refit: refit.objective)
        # The further cause has moved the machine about which the law was simulated.
        again = run_refits(self.scene, [renew_laws(self.scene, best)], self.settings.schedule)
        return [
            min(refit, *again, key=lambda refit: refit.objective) if refit is best else refit
            for refit in on_all
        ]


def has_law(refit: Refit) -> bool:
    """Return whether a law is one of the causes of a refit."""
    return any(isinstance(part, LawPart) for part in refit.session.model.parts)


def hold_law(task: RefitTask) -> RefitTask:
    """Return a refit on the tests of the highest level, with the law held; as it is without one."""
    campaign = task.session.campaign
    names = [
        parameter.name
        for part in task.session.model.parts
        if isinstance(part, LawPart)
        for parameter in part.parameters
    ]
    if not names or task.start is None:
        return task
    top = list_levels(campaign)[-1]
    tests = tuple(test for test in campaign.tests if test.condition.level_n == top)
    session = replace(
        task.session,
        campaign=replace(campaign, tests=tests),
        parametrisation=hold_parameters(task.session.parametrisation, task.start, names),
    )
    return replace(task, session=session)


def select_listed(
    before: Refit,
    refits: Sequence[Refit],
    hypotheses: int,
    small_faults: tuple[Key, ...],
    settings: DiagnosisSettings,
) -> list[Refit]:
    """Return the best refit, and those that a verdict would list beside the set before.

    Args:
        before: the set without their last cause.
        refits: refits with one more cause.
        hypotheses: number of effects and places that were scored.
        settings: what is material, and the least probability of a cause in a verdict.
    """
    best_of_keys: dict[Key, Refit] = {}
    for refit in sorted(refits, key=lambda refit: refit.objective):
        best_of_keys.setdefault(refit.keys[-1], refit)
    rivals = list(best_of_keys.values())
    sets = [refit.summary for refit in (before, *rivals)]
    evidence = Evidence(
        small_faults=small_faults,
        null=sets[0],
        sets=tuple(sets),
        hypotheses=hypotheses,
        variance=find_variance_source(before.session.campaign),
    )
    logs = compute_log_odds(evidence, sets, load_calibration())
    least = logs.max() + np.log(settings.min_row_probability)
    return [
        refit
        for number, (refit, log) in enumerate(zip(rivals, logs[1:], strict=True))
        if not number
        or (log >= least and refit.summary.is_material_step(before.summary, settings.min_closed))
    ]


def refit_on_all_levels(
    scene: Scene, refits: Sequence[Refit], settings: DiagnosisSettings
) -> list[Refit]:
    """Return refits on all levels, where those beside a law begin at their fits to one."""
    tasks = []
    for refit in refits:
        if has_law(refit):
            session = add_hypotheses(scene.session, *refit.causes)
            start = find_start(refit, session)
            tasks.append(RefitTask(refit.causes, session, start, refit.floor))
    on_all = iter(run_refits(scene, tasks, settings.schedule))
    return [next(on_all) if has_law(refit) else refit for refit in refits]
