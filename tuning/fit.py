"""Fit a model's parameters to a campaign, in logarithms, in stages of falling allowance."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from identification.words import Campaign, ModalModel, Real, UsageError
from mbmodel import Model
from tuning.modal import ModalCost, ModalStage
from tuning.residual import LogCost
from tuning.solver import Minimum, Outcome, minimise

_AGREE = 0.02  # two starts agree if their costs differ by less
_AGREE_MODES = 1e-3  # beside that, since the cost of modes can be as small as the modes are exact
_FEWEST_LINES = 32
_RANGE = np.log(100.0)  # every size stays within a factor of 100 of the drawing


@dataclass(frozen=True)
class Stage:
    """One minimisation of the logarithm of the FRFs' ratio.

    Args:
        allowance: relative error that the model may have anyway.
        stride: only every so manyth line counts.
    """

    allowance: float
    stride: int = 1


STAGES = (Stage(0.5, 4), Stage(0.2, 4), Stage(0.1, 2), Stage(0.03))


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
        theta: parameters in SI; (n_parameter,).
        cost: of the last stage.
        evaluations: of all starts and stages.
        outcome: how the best start ended.
        advice: what to do about it; empty if nothing.
        costs: of the last stage, one a start.
        agree: how many starts ended within 2 % of the best cost.
        at_bound: which parameters ended at a bound; (n_parameter,).
    """

    theta: Real
    cost: float
    evaluations: int
    outcome: Outcome
    advice: str
    costs: tuple[float, ...]
    agree: int
    at_bound: np.ndarray

    @property
    def converged(self) -> bool:
        """Whether the search came to its end."""
        return self.outcome == "converged"


def fit(
    model: Model,
    campaign: Campaign,
    *,
    starts: tuple[Real, ...] | None = None,
    stages: tuple[Stage | ModalStage, ...] = STAGES,
    measured: ModalModel | None = None,
    algorithm: str = "LD_LBFGS",
    report: Callable[[Progress], None] | None = None,
) -> Fit:
    """Tune every parameter of a model so that it answers as the campaign measured.

    Sizes are tuned by their logarithm: they keep their sign, and a factor up costs what a factor
    down does. Each start runs through all stages; the best is kept.

    Args:
        model: machine and Parts.
        campaign: the lines that count.
        starts: thetas in SI; the drawing alone if None.
        stages: in order, of FRFs or of modes.
        measured: modes inside the band, for stages of modes.
        algorithm: of NLopt.
        report: told about every evaluation.

    Returns:
        The best start's result; interrupted, the best point so far.

    Raises:
        UsageError: a stage of modes without modes.
    """
    drawn = np.log(model.drawn)
    bounds = (drawn - _RANGE, drawn + _RANGE)
    costs = [_cost(model, campaign, measured, stage) for stage in stages]
    ends: list[Minimum] = []
    evaluations = 0
    for number, start in enumerate(starts or (model.drawn,)):
        end = Minimum(np.log(start), np.inf, 0, "converged", "")
        for stage, cost in enumerate(costs):

            def tell(count: int, value: float, at: tuple[int, int] = (number, stage)) -> None:
                if report is not None:
                    report(Progress(*at, count, value))

            end = minimise(_begun(cost, end.x), end.x, bounds, algorithm=algorithm, report=tell)
            evaluations += end.evaluations
            if end.outcome == "interrupted":
                break
        ends.append(_comparable(costs[-1], end))
        if end.outcome == "interrupted":
            break
    slack = _AGREE_MODES if isinstance(costs[-1], ModalCost) else 0.0
    return _best(ends, evaluations, bounds, slack)


class _Logarithmic:
    """A cost of theta as a cost of log theta: dJ/dx = theta dJ/dtheta."""

    def __init__(self, cost: LogCost | ModalCost) -> None:
        self._cost = cost

    def __call__(self, x: Real) -> tuple[float, Real]:
        theta = np.exp(x)
        value, gradient = self._cost(theta)
        return value, gradient * theta


def _cost(
    model: Model, campaign: Campaign, measured: ModalModel | None, stage: Stage | ModalStage
) -> LogCost | ModalCost:
    if isinstance(stage, Stage):
        return LogCost(model, _thin(campaign, stage), stage.allowance)
    if measured is None:
        raise UsageError("a stage of modes needs measured modes: identify the campaign first")
    return ModalCost(model, measured, stage)


def _begun(cost: LogCost | ModalCost, x: Real) -> _Logarithmic:
    """The cost of a search that begins at x, where modes find their partners."""
    return _Logarithmic(cost.begin(np.exp(x)) if isinstance(cost, ModalCost) else cost)


def _comparable(cost: LogCost | ModalCost, end: Minimum) -> Minimum:
    """Of modes, the cost without what ties it to its own start, all modes counted again."""
    if isinstance(cost, LogCost) or end.outcome == "interrupted":
        return end
    return replace(end, value=cost.pairs(np.exp(end.x)).cost)


def _thin(campaign: Campaign, stage: Stage) -> Campaign:
    """Every stride-th line, but no fewer than 32 of them as long as there are so many."""
    stride = min(stage.stride, max(1, len(campaign.freq_hz) // _FEWEST_LINES))
    return campaign.lines(slice(stride // 2, None, stride))


def _best(ends: list[Minimum], evaluations: int, bounds: tuple[Real, Real], slack: float) -> Fit:
    finished = [end for end in ends if end.outcome != "interrupted"] or ends
    best = min(finished, key=lambda end: end.value)
    interrupted = ends[-1].outcome == "interrupted"
    return Fit(
        theta=np.exp(best.x),
        cost=best.value,
        evaluations=evaluations,
        outcome="interrupted" if interrupted else best.outcome,
        advice=ends[-1].advice if interrupted else best.advice,
        costs=tuple(end.value for end in finished),
        agree=sum(end.value <= best.value * (1 + _AGREE) + slack for end in finished),
        at_bound=(best.x <= bounds[0] + 1e-6) | (best.x >= bounds[1] - 1e-6),
    )


def random_starts(model: Model, count: int, seed: int, spread: float = 0.5) -> tuple[Real, ...]:
    """The drawing, and ``count - 1`` starts whose factors on it are exp(N(0, spread))."""
    random = np.random.default_rng(seed)
    factors = np.exp(random.normal(0.0, spread, (max(count - 1, 0), len(model.drawn))))
    return (model.drawn, *(model.drawn * factor for factor in factors))
