"""Fit of a model to a campaign in stages of falling model-error floor, from several starts."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from identification.words import Campaign, Mask, ModalModel, Real, UsageError
from mbmodel import Model
from tuning.fitting.checkpoint import Checkpoint
from tuning.fitting.stage_search import GAUSS_NEWTON, STAGES, Stage, minimise_stage, thin_lines
from tuning.misfit.modal_misfit import ModalCost, ModalStage
from tuning.misfit.mode_table_misfit import ModeTableMisfit, TableStage
from tuning.parametrisation.parametrisation import Parametrisation
from tuning.parametrisation.user_specification import parametrise
from tuning.solvers.gauss_newton import Box, gauss_newton
from tuning.solvers.nlopt_solver import (
    INTERRUPTED_ADVICE,
    TUNING_ALGORITHM,
    Minimum,
    Outcome,
    minimise,
)
from tuning.workers.executors import use_processes
from tuning.workers.independent_calls import Call, run_calls

MAX_COST_DIFFERENCE = 0.02  # relative: starts that end within it agree
# Absolute part of that for modes, whose cost vanishes if they are fitted exactly.
_MAX_MODAL_COST_DIFFERENCE = 1e-3
# Of a table of modes: the largest step of a coordinate [prior standard deviations], since modes
# change order within a few, and the number of steps.
_MAX_TABLE_STEP_SIGMA, _MAX_TABLE_STEPS = 1.0, 200

AnyStage = Stage | ModalStage | TableStage
_NumberedStages = tuple[tuple[int, AnyStage], ...]


@dataclass(frozen=True, eq=False)
class FitProgress:
    """Progress of a fit, for its display.

    Args:
        start: index of the start.
        stage: index of the stage.
        evaluation: number of evaluations of the stage.
        cost: best cost so far.
    """

    start: int
    stage: int
    evaluation: int
    cost: float


@dataclass(frozen=True, eq=False)
class Fit:
    """A tuned model.

    Args:
        parametrisation: parameters that varied.
        x: their coordinates; (n_x,).
        cost: cost of the last stage, in nats for FRFs.
        evaluations: evaluations of all starts and stages.
        outcome: how the best start ended.
        advice: what to do about it; empty if nothing.
        start_costs: cost of each start after the last stage that every start went through.
        agreement_cost: cost up to which a start agrees with the best one: 2 % above it.
        start_thetas: theta of each start there; (n_start, n_parameter).
        last_stage: last stage; None if it fitted modes.
    """

    parametrisation: Parametrisation
    x: Real
    cost: float
    evaluations: int
    outcome: Outcome
    advice: str
    start_costs: tuple[float, ...]
    agreement_cost: float
    start_thetas: Real
    last_stage: Stage | None

    def __repr__(self) -> str:
        """Return outcome, number of parameters and cost in one line."""
        return f"fit: {self.outcome}, {self.parametrisation.size} parameters, cost {self.cost:.6g}"

    @property
    def theta(self) -> Real:
        """Parameters [SI]; (n_parameter,)."""
        return self.parametrisation.theta(self.x)

    @property
    def agreeing_starts(self) -> int:
        """Number of starts that agree with the best."""
        return sum(cost <= self.agreement_cost for cost in self.start_costs)

    @property
    def converged(self) -> bool:
        """Whether the search converged."""
        return self.outcome == "converged"

    @property
    def at_bound(self) -> Mask:
        """Whether each parameter ended at a bound; (n_parameter,)."""
        return self.parametrisation.parameters_at_bound(self.x)


@dataclass(frozen=True, eq=False)
class _Search:
    """What the fits from all starts have in common.

    A stage of FRFs needs a campaign, a stage of modes measured ones; a stage of a table of modes
    has its table.
    """

    model: Model
    campaign: Campaign | None
    parametrisation: Parametrisation
    measured: ModalModel | None = None
    algorithm: str = GAUSS_NEWTON
    threads: int = 1
    checkpoint: Checkpoint = field(default_factory=Checkpoint)

    def run(
        self,
        begin: Minimum,
        stages: _NumberedStages,
        name: str,
        report: Callable[[int, int, float], None] | None = None,
    ) -> Minimum:
        """Run some stages in turn, each from the end of the one before; finished steps are kept.

        Args:
            begin: start of the first stage.
            stages: stages with their numbers.
            name: name of the steps in the checkpoint.
            report: called with the stage's number, its evaluations and the best value.

        Raises:
            KeyboardInterrupt: interrupted before any stage has ended.
        """
        end, evaluations = begin, 0
        for number, stage in stages:

            def report_stage(count: int, value: float, stage_number: int = number) -> None:
                if report is not None:
                    report(stage_number, count, value)

            run, step = (
                partial(self._run_stage, stage, end.x, report_stage),
                f"{name}, stage {number}",
            )
            try:
                end = self.checkpoint.run_step(step, run)
            except KeyboardInterrupt:  # while a stage is set up, or its end is written
                end = self.checkpoint.recall(step) or end
                if not np.isfinite(end.value):
                    raise
                end = replace(end, evaluations=0, outcome="interrupted", advice=INTERRUPTED_ADVICE)
            evaluations += end.evaluations
            if end.outcome == "interrupted":
                break
        return replace(end, evaluations=evaluations)

    def _run_stage(self, stage: AnyStage, x: Real, report: Callable[[int, float], None]) -> Minimum:
        """Run one stage from x, with the coordinates that it varies."""
        whole = self.parametrisation
        if isinstance(stage, TableStage):
            return self._fit_table(stage, x, report)
        varied = np.ones(whole.size, bool)
        tolerances_vary = isinstance(stage, Stage) and stage.tolerances_vary
        if not tolerances_vary and not whole.is_tolerance.all():
            varied = ~whole.is_tolerance
        chosen = whole.restrict(varied, x)
        if isinstance(stage, ModalStage):
            end = self._fit_modes(stage, chosen, x[varied], report)
        elif self.campaign is None:
            raise UsageError("a stage of FRFs needs a campaign: read one first")
        else:
            thin = thin_lines(self.campaign, stage.stride)
            problem = stage.build_problem(self.model, thin, chosen, threads=self.threads)
            is_joint = tolerances_vary and bool(chosen.is_tolerance.any())
            algorithm = GAUSS_NEWTON if is_joint else self.algorithm
            end = minimise_stage(
                problem, chosen, x[varied], stage, algorithm=algorithm, report=report
            )
        x_all = x.copy()
        x_all[varied] = end.x
        return replace(end, x=x_all)

    def _fit_table(
        self, stage: TableStage, x: Real, report: Callable[[int, float], None]
    ) -> Minimum:
        """Run one stage of the misfit to a table of modes from x."""
        whole = self.parametrisation
        max_step = np.full(whole.size, _MAX_TABLE_STEP_SIGMA)
        return gauss_newton(
            ModeTableMisfit(self.model, whole, stage),
            x,
            Box(whole.lower, whole.upper, whole.precision, max_step),
            min_gain_nats=stage.min_gain_nats,
            tolerance=0.0,
            max_steps=_MAX_TABLE_STEPS,
            exact_curvature=True,
            report=report,
        )

    def _fit_modes(
        self,
        stage: ModalStage,
        chosen: Parametrisation,
        x: Real,
        report: Callable[[int, float], None],
    ) -> Minimum:
        """Run one stage of the modal misfit from x."""
        if self.measured is None:
            raise UsageError(
                "a stage of modes needs measured modes: identify the campaign's modes first"
            )
        cost = ModalCost(self.model, self.measured, stage)
        search_cost = cost.start_at(chosen.theta(x))

        def objective(x: Real) -> tuple[float, Real]:
            value, gradient = search_cost(chosen.theta(x))
            return value, chosen.gradient_by_coordinates(gradient, x)

        algorithm = TUNING_ALGORITHM if self.algorithm == GAUSS_NEWTON else self.algorithm
        end = minimise(
            objective, x, (chosen.lower, chosen.upper), algorithm=algorithm, report=report
        )
        if end.outcome == "interrupted":
            return end
        # The cost of all modes, without the prior about the start of the search.
        return replace(end, value=cost.pairs(chosen.theta(end.x)).cost)


def fit(  # noqa: PLR0913  # one for each option
    model: Model,
    campaign: Campaign,
    *,
    parametrisation: Parametrisation | None = None,
    starts: tuple[Real, ...] | None = None,
    stages: "tuple[Stage | ModalStage, ...]" = STAGES,
    measured: ModalModel | None = None,
    algorithm: str = GAUSS_NEWTON,
    jobs: int = 1,
    report: Callable[[FitProgress], None] | None = None,
    checkpoint: Checkpoint | None = None,
    name: str = "fit",
) -> Fit:
    """Fit a model's parameters to the FRFs or modes of a campaign (maximum a posteriori).

    The first stages vary the parameters without a prior, from every start. The other stages, in
    which tolerances vary too, continue from the best start. If there are only stages of one kind,
    every start goes through all of them.

    Args:
        parametrisation: coordinates; by default of all that is not known exactly, with the
            campaign's tolerances.
        starts: theta of each start [SI]; the nominal model alone if None.
        stages: stages in order, of FRFs or of modes.
        measured: modes inside the band, for stages of modes.
        algorithm: name of an algorithm of NLopt, or the Gauss-Newton method, for stages in which
            stiffness and damping alone vary. Stages with tolerances have hundreds of parameters and
            use the Gauss-Newton method.
        jobs: processes for several starts, threads for one; the result does not depend on it.
        report: called at every evaluation; with several processes, in the last stages alone.
        name: name of this fit in the checkpoint.

    Returns:
        The result of the best start; if interrupted, the best point so far.

    Raises:
        UsageError: a stage of modes without modes, or an algorithm that NLopt does not have.
    """
    parametrisation = (
        parametrise(model, campaign.tolerance) if parametrisation is None else parametrisation
    )
    checkpoint = Checkpoint() if checkpoint is None else checkpoint
    search = _Search(model, campaign, parametrisation, measured, algorithm, jobs, checkpoint)
    begun = starts or (parametrisation.start,)
    start_points = [parametrisation.coordinates(start) for start in begun]
    numbered = tuple(enumerate(stages))
    is_joint = [isinstance(stage, Stage) and stage.tolerances_vary for stage in stages]
    n_separate = is_joint.index(True) if any(is_joint) and not is_joint[0] else len(stages)
    ends = _fit_all_starts(search, start_points, numbered[:n_separate], name, report)
    best = int(np.argmin([end.value for end in ends]))
    last_separate = stages[n_separate - 1] if n_separate else None
    margin = _MAX_MODAL_COST_DIFFERENCE if isinstance(last_separate, ModalStage) else 0.0
    end, evaluations = ends[best], [end.evaluations for end in ends]
    if n_separate < len(stages) and ends[-1].outcome != "interrupted":
        end = search.run(end, numbered[n_separate:], f"{name}, best", _report_from(report, best))
        evaluations.append(end.evaluations)
    elif ends[-1].outcome == "interrupted":
        end = replace(end, outcome="interrupted", advice=ends[-1].advice)
    return Fit(
        parametrisation=parametrisation,
        x=end.x,
        cost=end.value,
        evaluations=sum(evaluations),
        outcome=end.outcome,
        advice=end.advice,
        start_costs=tuple(end_of_start.value for end_of_start in ends),
        agreement_cost=ends[best].value * (1 + MAX_COST_DIFFERENCE) + margin,
        start_thetas=np.array([parametrisation.theta(end_of_start.x) for end_of_start in ends]),
        last_stage=stages[-1] if stages and isinstance(stages[-1], Stage) else None,
    )


def _report_from(
    report: Callable[[FitProgress], None] | None, start: int
) -> Callable[[int, int, float], None] | None:
    """Return a report function that adds the number of the start."""
    if report is None:
        return None
    return lambda stage, count, value: report(FitProgress(start, stage, count, value))


def _start_point(x: Real) -> Minimum:
    """Return the state of a search before its first evaluation."""
    return Minimum(x, np.inf, 0, "converged", "")


def _fit_all_starts(
    search: _Search,
    start_points: list[Real],
    stages: _NumberedStages,
    name: str,
    report: Callable[[FitProgress], None] | None,
) -> list[Minimum]:
    """Run the first stages from every start.

    If interrupted, return the starts that ended and the interrupted one.
    """
    if search.threads > 1 and len(start_points) > 1:
        return _fit_in_parallel(search, start_points, stages, name)
    ends: list[Minimum] = []
    for number, x in enumerate(start_points):
        try:
            end = search.run(
                _start_point(x), stages, f"{name}, start {number}", _report_from(report, number)
            )
        except KeyboardInterrupt:
            if not ends:
                raise
            end = Minimum(x, np.inf, 0, "interrupted", INTERRUPTED_ADVICE)
        if end.outcome == "interrupted" and ends:
            end = replace(end, value=np.inf)
        ends.append(end)
        if end.outcome == "interrupted":
            break
    return ends


def _fit_in_parallel(
    search: _Search,
    start_points: list[Real],
    stages: _NumberedStages,
    name: str,
) -> list[Minimum]:
    """Run the first stages from every start in processes; each start is one checkpoint step."""
    checkpoint = search.checkpoint
    ends = [checkpoint.recall(f"{name}, start {number}") for number in range(len(start_points))]
    missing = [number for number, end in enumerate(ends) if end is None]
    calls: list[Call] = [
        (_fit_one_start, (search, start_points[number], stages)) for number in missing
    ]
    try:
        for result in run_calls(calls, use_processes(search.threads)):
            number, end = missing[result.index], result.unwrap()
            ends[number] = end
            checkpoint.keep(f"{name}, start {number}", end)
    except KeyboardInterrupt:
        finished = [end for end in ends if end is not None]
        x = min(finished, key=lambda end: end.value).x if finished else start_points[0]
        return [*finished, Minimum(x, np.inf, 0, "interrupted", INTERRUPTED_ADVICE)]
    return [end for end in ends if end is not None]


def _fit_one_start(search: _Search, x: Real, stages: _NumberedStages) -> Minimum:
    """Run the first stages from one start in a process of its own."""
    return replace(search, threads=1, checkpoint=Checkpoint()).run(_start_point(x), stages, "")


def fit_table(
    model: Model, parametrisation: Parametrisation, x: Real, stages: Sequence[TableStage]
) -> Minimum:
    """Run stages of a table of modes from one start.

    Args:
        parametrisation: coordinates; all of them have a prior.
        x: start; (n_x,).
        stages: stages in order.
    """
    return _Search(model, None, parametrisation).run(_start_point(x), tuple(enumerate(stages)), "")
