"""Fit a model to a campaign in stages of falling allowance, from several starts."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from identification.words import Campaign, Mask, ModalModel, Real, UsageError
from mbmodel import Model
from tuning.fitting.checkpoint import Journal
from tuning.fitting.stages import STAGES, Stage, thinned
from tuning.misfit.misfit import Misfit, Sparse
from tuning.misfit.modal_misfit import ModalCost, ModalStage
from tuning.misfit.normal_equations import Arrow
from tuning.parametrisation.parametrisation import Freedom
from tuning.parametrisation.user_specification import freedom
from tuning.solvers.gauss_newton import LARGEST_STEP, Box, gauss_newton
from tuning.solvers.nlopt_solver import INTERRUPTED, Minimum, Outcome, minimise

GAUSS_NEWTON = "GAUSS_NEWTON"
_AGREE = 0.02  # two starts agree if their costs differ by less
_AGREE_MODES = 1e-3  # beside that, since the cost of modes can be as small as the modes are exact
_FAR, _NEAR = 1e-3, 1e-7  # damping at the beginning of a stage


_Numbered = tuple[tuple[int, Stage | ModalStage], ...]


@dataclass(frozen=True, eq=False)
class Progress:
    """Where a fit stands, for whoever shows it."""

    start: int
    stage: int
    evaluation: int
    cost: float


@dataclass(frozen=True, eq=False)
class Fit:
    """A tuned model.

    Args:
        freedom: what was tuned.
        x: its coordinates; (n_x,).
        cost: of the last stage, in nats where FRFs were fitted.
        evaluations: of all starts and stages.
        outcome: how the best start ended.
        advice: what to do about it; empty if nothing.
        costs: of the last stage that every start went through, one a start.
        agreed: the cost up to which a start agrees with the best of these: 2 % above it.
        ends: theta of each start there; (n_start, n_parameter).
        last: the stage that it ended with; None if that was one of modes.
    """

    freedom: Freedom
    x: Real
    cost: float
    evaluations: int
    outcome: Outcome
    advice: str
    costs: tuple[float, ...]
    agreed: float
    ends: Real
    last: Stage | None

    @property
    def theta(self) -> Real:
        """Parameters in SI; (n_parameter,)."""
        return self.freedom.theta(self.x)

    @property
    def agree(self) -> int:
        """How many starts agree with the best."""
        return sum(cost <= self.agreed for cost in self.costs)

    @property
    def converged(self) -> bool:
        """Whether the search came to its end."""
        return self.outcome == "converged"

    @property
    def at_bound(self) -> Mask:
        """Which parameters ended at a bound; (n_parameter,)."""
        return self.freedom.at_bound(self.x)


@dataclass(frozen=True, eq=False)
class _Search:
    """What every start has in common."""

    model: Model
    campaign: Campaign
    freedom: Freedom
    measured: ModalModel | None
    algorithm: str
    threads: int
    journal: Journal

    def run(
        self,
        begin: Minimum,
        stages: _Numbered,
        name: str,
        report: Callable[[int, int, float], None] | None = None,
    ) -> Minimum:
        """Go through some stages, each told by its number, from an end; steps are kept by name.

        Raises:
            KeyboardInterrupt: before anything was found, here or by who came before.
        """
        end, evaluations = begin, 0
        for number, stage in stages:

            def tell(count: int, value: float, at: int = number) -> None:
                if report is not None:
                    report(at, count, value)

            make, step = partial(self._stage, stage, end.x, tell), f"{name}, stage {number}"
            try:
                end = self.journal.step(step, make)
            except KeyboardInterrupt:  # while a stage is made ready, or its end is kept
                end = self.journal.recall(step) or end
                if not np.isfinite(end.value):
                    raise
                end = replace(end, evaluations=0, outcome="interrupted", advice=INTERRUPTED)
            evaluations += end.evaluations
            if end.outcome == "interrupted":
                break
        return replace(end, evaluations=evaluations)

    def _stage(
        self, stage: Stage | ModalStage, x: Real, tell: Callable[[int, float], None]
    ) -> Minimum:
        whole = self.freedom
        varies = np.ones(whole.size, bool)
        everything = isinstance(stage, Stage) and stage.everything
        if not everything and not whole.has_prior.all():
            varies = ~whole.has_prior
        chosen = whole.only(varies, x)
        if isinstance(stage, ModalStage):
            end = self._by_modes(stage, chosen, x[varies], tell)
        else:
            thin = thinned(self.campaign, stage.stride)
            problem = stage.problem(self.model, thin, chosen, threads=self.threads)
            if everything or self.algorithm == GAUSS_NEWTON:
                end = descend(problem, chosen, x[varies], stage, report=tell)
            else:
                bounds = (chosen.lower, chosen.upper)
                end = minimise(problem, x[varies], bounds, algorithm=self.algorithm, report=tell)
        found = x.copy()
        found[varies] = end.x
        return replace(end, x=found)

    def _by_modes(
        self, stage: ModalStage, chosen: Freedom, x: Real, tell: Callable[[int, float], None]
    ) -> Minimum:
        if self.measured is None:
            raise UsageError("a stage of modes needs measured modes: identify the campaign first")
        cost = ModalCost(self.model, self.measured, stage)
        begun = cost.begin(chosen.theta(x))

        def objective(x: Real) -> tuple[float, Real]:
            value, gradient = begun(chosen.theta(x))
            return value, chosen.collected(gradient, x)

        algorithm = "LD_LBFGS" if self.algorithm == GAUSS_NEWTON else self.algorithm
        end = minimise(objective, x, (chosen.lower, chosen.upper), algorithm=algorithm, report=tell)
        if end.outcome == "interrupted":
            return end
        # Without what ties it to its own start, all modes counted again.
        return replace(end, value=cost.pairs(chosen.theta(end.x)).cost)


def descend(
    problem: Misfit | Sparse,
    varies: Freedom,
    x: Real,
    stage: Stage,
    *,
    known: Arrow | None = None,
    promise: float = 0.01,
    report: Callable[[int, float], None] | None = None,
) -> Minimum:
    """Gauss-Newton with the bounds and priors of what varies.

    Args:
        problem: of this stage.
        varies: its coordinates.
        x: where to begin; (n_x,).
        stage: how far to go.
        known: normal equations near x, where somebody has them.
        promise: it ends when the next step will promise less, in nats.
        report: told about every evaluation.
    """
    return gauss_newton(
        problem,
        x,
        Box(
            varies.lower,
            varies.upper,
            varies.has_prior.astype(float),
            np.where(varies.is_logarithm & ~varies.has_prior, LARGEST_STEP / varies.scales, np.inf),
        ),
        known=known,
        promise=promise,
        damping=_FAR if stage.allowance > 0 else _NEAR,
        tolerance=stage.tolerance,
        max_steps=stage.max_steps,
        curved=stage.curved,
        report=report,
    )


def fit(  # noqa: PLR0913  # one for each option
    model: Model,
    campaign: Campaign,
    *,
    varies: Freedom | None = None,
    starts: tuple[Real, ...] | None = None,
    stages: "tuple[Stage | ModalStage, ...]" = STAGES,
    measured: ModalModel | None = None,
    algorithm: str = GAUSS_NEWTON,
    jobs: int = 1,
    report: Callable[[Progress], None] | None = None,
    journal: Journal | None = None,
    name: str = "fit",
) -> Fit:
    """Tune a model so that it answers as the campaign measured.

    The first stages vary what the drawing does not know, from every start; the others, in which
    tolerances vary too, go on from the best. Where no stage is of that kind, all stages are gone
    through from every start.

    Args:
        model: machine and Parts.
        campaign: the lines that count.
        varies: coordinates; by default all that is not known exactly, tolerances of the campaign.
        starts: thetas in SI; the drawing alone if None.
        stages: in order, of FRFs or of modes.
        measured: modes inside the band, for stages of modes.
        algorithm: of NLopt, by name, for the first stages; Gauss-Newton by default and at the end.
        jobs: processes for the starts, threads of a single one; the result does not depend on it.
        report: told about every evaluation; with several processes, of the last stages alone.
        journal: knows finished steps, which are not made again.
        name: of this fit in the journal.

    Returns:
        The best start's result; interrupted, the best point so far.

    Raises:
        UsageError: a stage of modes without modes, an algorithm that NLopt does not have.
    """
    varies = freedom(model, campaign.tolerance) if varies is None else varies
    journal = Journal() if journal is None else journal
    search = _Search(model, campaign, varies, measured, algorithm, jobs, journal)
    begins = [varies.coordinates(start) for start in starts or (model.drawn,)]
    numbered = tuple(enumerate(stages))
    joint = [isinstance(stage, Stage) and stage.everything for stage in stages]
    split = joint.index(True) if any(joint) and not joint[0] else len(stages)
    ends = _from_all(search, begins, numbered[:split], name, report)
    best = int(np.argmin([end.value for end in ends]))
    last = stages[split - 1] if split else None
    slack = _AGREE_MODES if isinstance(last, ModalStage) else 0.0
    end, others = ends[best], [end.evaluations for end in ends]
    if split < len(stages) and ends[-1].outcome != "interrupted":
        end = search.run(end, numbered[split:], f"{name}, best", _told(report, best))
        others.append(end.evaluations)
    elif ends[-1].outcome == "interrupted":
        end = replace(end, outcome="interrupted", advice=ends[-1].advice)
    return Fit(
        freedom=varies,
        x=end.x,
        cost=end.value,
        evaluations=sum(others),
        outcome=end.outcome,
        advice=end.advice,
        costs=tuple(one.value for one in ends),
        agreed=ends[best].value * (1 + _AGREE) + slack,
        ends=np.array([varies.theta(one.x) for one in ends]),
        last=stages[-1] if stages and isinstance(stages[-1], Stage) else None,
    )


def _told(
    report: Callable[[Progress], None] | None, start: int
) -> Callable[[int, int, float], None] | None:
    if report is None:
        return None
    return lambda stage, count, value: report(Progress(start, stage, count, value))


def _begun(x: Real) -> Minimum:
    """Where nothing is found yet."""
    return Minimum(x, np.inf, 0, "converged", "")


def _from_all(
    search: _Search,
    begins: list[Real],
    stages: _Numbered,
    name: str,
    report: Callable[[Progress], None] | None,
) -> list[Minimum]:
    """The first stages from every start; after an interrupt, those that were finished and it."""
    if search.threads > 1 and len(begins) > 1:
        return _side_by_side(search, begins, stages, name)
    ends: list[Minimum] = []
    for number, x in enumerate(begins):
        try:
            end = search.run(_begun(x), stages, f"{name}, start {number}", _told(report, number))
        except KeyboardInterrupt:
            if not ends:
                raise
            end = Minimum(x, np.inf, 0, "interrupted", INTERRUPTED)
        if end.outcome == "interrupted" and ends:
            end = replace(end, value=np.inf)
        ends.append(end)
        if end.outcome == "interrupted":
            break
    return ends


def _side_by_side(
    search: _Search,
    begins: list[Real],
    stages: _Numbered,
    name: str,
) -> list[Minimum]:
    """The first stages from every start, in processes; each start is a step of the journal."""
    journal = search.journal
    known = [journal.recall(f"{name}, start {number}") for number in range(len(begins))]
    missing = [number for number, end in enumerate(known) if end is None]
    work = (delayed(_alone)(search, begins[number], stages) for number in missing)
    try:
        made = Parallel(n_jobs=search.threads, return_as="generator")(work)
        for number, end in zip(missing, made, strict=True):
            known[number] = end
            journal.keep(f"{name}, start {number}", end)
    except KeyboardInterrupt:
        finished = [end for end in known if end is not None]
        x = min(finished, key=lambda end: end.value).x if finished else begins[0]
        return [*finished, Minimum(x, np.inf, 0, "interrupted", INTERRUPTED)]
    return [end for end in known if end is not None]


def _alone(search: _Search, x: Real, stages: _Numbered) -> Minimum:
    with threadpool_limits(1):
        return replace(search, threads=1, journal=Journal()).run(_begun(x), stages, "")


def random_starts(
    model: Model, count: int, seed: int, spread: float = 0.5, varies: Freedom | None = None
) -> tuple[Real, ...]:
    """The drawing, and ``count - 1`` starts: sizes that it does not know times exp(N(0, spread)).

    Args:
        model: machine and Parts.
        count: how many, the drawing among them.
        seed: of the others.
        spread: of the logarithms.
        varies: what varies, and what of it has a prior; by default as the Parts say.
    """
    random = np.random.default_rng(seed)
    free = np.array([one.positive and one.known == "free" for one in model.parameters], bool)
    if varies is not None:
        sizes = np.append(varies.is_logarithm & ~varies.has_prior, False)
        free = sizes[varies.member]
    normal = random.normal(0.0, spread, (max(count - 1, 0), int(free.sum())))
    factors = np.ones((len(normal), len(free)))
    factors[:, free] = np.exp(normal)
    return (model.drawn, *(model.drawn * factor for factor in factors))
