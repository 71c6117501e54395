"""Fit of a machine to a campaign at its own model-error floor: what tuning and diagnosis share.

1. The first stages fit the logarithm of FRFs (or modes), from all starts.
2. Parameters and floor are fitted in turn (``error_floor_fit``), and tolerances that lie beyond
   their bounds by chance are admitted.
3. Each fold of lines is predicted by a fit without it, at that floor (``assessment.held_out``).

A diagnosis begins at the end of 2, so that the gap of a tuning is that of its null model.

Tolerances that lie beyond their bounds by chance.

Among hundreds of tolerances some exceed their bounds of 2.5 standard deviations by chance. Held at
the bound, such a tolerance leaves a gap that looks like an effect, or like an error of the model
beside one. So those at a bound are fitted up to 4.5 standard deviations, however many they are: one
outlier that is held drives others to their bounds, and these come back once it is free. One that
ends there too is a fault, which no tolerance may hide. So are several that are improbable together:
of n tolerances, the binomial probability that k shift as far as the k-th largest must not be below
that of one beyond 4.5.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.special import betainc, ndtr

from identification.words import TOLERANCE_BOUND_SIGMA, Campaign, ModalModel, Real
from mbmodel import Model
from tuning.fitting.checkpoint import Checkpoint
from tuning.fitting.error_floor_fit import (
    FloorFit,
    FloorSchedule,
    count_measured_frfs,
    fit_at_error_floor,
)
from tuning.fitting.fitter import Fit, FitProgress, fit
from tuning.fitting.stage_search import LAST_STAGE, STAGES, Stage, thin_lines
from tuning.misfit.batch import predict
from tuning.misfit.modal_misfit import ModalStage
from tuning.misfit.residual_statistics import ModelError, estimate_model_error
from tuning.parametrisation.parametrisation import Parametrisation
from tuning.solvers.nlopt_solver import TUNING_ALGORITHM, Minimum

FIRST_STAGES = STAGES[:3]
_FLOOR_STEP = "model-error floor"  # name of a step of the checkpoint
# FRFs below which several machines fit: a campaign of n starts 48 / n times.
_FEW_FRFS = 48


def count_starts(campaign: Campaign, starts: int = 1) -> int:
    """Return the number of starts: as many as are wanted, and more where few FRFs were measured."""
    return max(starts, round(_FEW_FRFS / max(1, count_measured_frfs(campaign))))


def random_starts(
    model: Model,
    count: int,
    seed: int,
    spread: float = 0.5,
    parametrisation: Parametrisation | None = None,
) -> tuple[Real, ...]:
    """Return the nominal parameters, and ``count - 1`` random starts.

    A random start multiplies the sizes that vary without a prior by factors exp(N(0, spread)).

    Args:
        count: number of starts, the nominal one included.
        spread: standard deviation of the logarithms.
        parametrisation: parameters that vary and their priors; by default as the Parts say.

    Returns:
        theta of each start [SI]; (n_parameter,) each.
    """
    random = np.random.default_rng(seed)
    free = np.array(
        [p.positive and p.known in ("free", "stiffness", "damping") for p in model.parameters], bool
    )
    if parametrisation is not None:
        sizes = np.append(parametrisation.is_logarithmic & ~parametrisation.is_tolerance, False)
        free = sizes[parametrisation.coordinate_of]
    normal = random.normal(0.0, spread, (max(count - 1, 0), int(free.sum())))
    factors = np.ones((len(normal), len(free)))
    factors[:, free] = np.exp(normal)
    nominal = model.drawn if parametrisation is None else parametrisation.start
    return (nominal, *(nominal * factor for factor in factors))


def fit_first_stages(  # noqa: PLR0913  # one for each option
    model: Model,
    campaign: Campaign,
    parametrisation: Parametrisation,
    schedule: FloorSchedule,
    *,
    stages: "tuple[Stage | ModalStage, ...]" = FIRST_STAGES,
    starts: int = 1,
    seed: int = 0,
    measured: ModalModel | None = None,
    algorithm: str = TUNING_ALGORITHM,
    jobs: int = 1,
    report: Callable[[FitProgress], None] | None = None,
    checkpoint: Checkpoint | None = None,
) -> Fit:
    """Fit the stages before the first fit at a floor, from all starts.

    Args:
        schedule: schedule for the lines of the campaign (``FloorSchedule.thin``).
        stages: stages in order.
        starts: number of starts: the nominal model, then random ones.
        measured: modes inside the band, for stages of modes.
        algorithm: algorithm of the stages in which stiffness and damping alone vary.
        jobs: processes for several starts, threads for one; the result does not depend on it.
        report: called at every evaluation.
    """
    return fit(
        model,
        campaign,
        parametrisation=parametrisation,
        starts=random_starts(model, starts, seed, parametrisation=parametrisation),
        stages=tuple(
            replace(stage, stride=stage.stride * schedule.first_stride_factor)
            if isinstance(stage, Stage)
            else stage
            for stage in stages
        ),
        measured=measured,
        algorithm=algorithm,
        jobs=jobs,
        report=report,
        checkpoint=checkpoint,
    )


def settle_floor(
    model: Model,
    campaign: Campaign,
    first: Fit,
    schedule: FloorSchedule,
    *,
    jobs: int = 1,
    checkpoint: Checkpoint | None = None,
) -> tuple[Fit, ModelError]:
    """Fit parameters and floor in turn, and admit tolerances beyond their bounds by chance.

    Args:
        first: fit of the first stages.
        schedule: schedule for the lines of the campaign.
        jobs: threads; the result does not depend on it.

    Returns:
        The fit, in whose coordinates admitted tolerances have wider bounds, and the model error
        that its residuals show.

    Raises:
        KeyboardInterrupt: interrupted.
        ValueError: no channel moves.
    """
    checkpoint = Checkpoint() if checkpoint is None else checkpoint
    narrow = first.parametrisation

    def search() -> Minimum:
        settled = _admit_outliers(model, campaign, first, schedule, jobs).fit
        last = settled.last_stage or schedule.stage(0.0)
        kept = np.append(settled.x, last.model_error_floor)
        return Minimum(kept, settled.cost, settled.evaluations, settled.outcome, settled.advice)

    end = checkpoint.run_step(_FLOOR_STEP, search)
    x = end.x[:-1]
    varies = admit_shifts(narrow, x)
    counted = thin_lines(campaign, schedule.stride // 2)
    error = estimate_model_error(predict(model, varies.theta(x), counted), counted)
    if error is None:
        raise ValueError("no channel moves, so that no model error shows")
    settled = replace(
        first,
        parametrisation=varies,
        x=x,
        cost=end.value,
        evaluations=first.evaluations + end.evaluations,
        outcome=end.outcome,
        advice=end.advice,
        last_stage=schedule.stage(float(end.x[-1])),
    )
    return settled, error


def _admit_outliers(
    model: Model, campaign: Campaign, first: Fit, schedule: FloorSchedule, jobs: int
) -> FloorFit:
    """Return the fit at its own floor, with outlying tolerances where they lower the cost."""
    narrow = first.parametrisation
    settled = fit_at_error_floor(
        model, campaign, narrow, start=first.theta, schedule=schedule, jobs=jobs
    )
    wide = widen_outliers(narrow, settled.fit.x)
    if wide is None:
        return settled
    wider = fit_at_error_floor(
        model,
        campaign,
        wide,
        start=settled.fit.theta,
        floor=settled.error.floor,
        schedule=schedule,
        jobs=jobs,
    )
    is_better = _objective(wider) < _objective(settled)
    return wider if is_better and are_by_chance(narrow, wide, wider.fit.x) else settled


def _objective(settled: FloorFit) -> float:
    """Return -ln L at the floor and the cost of the priors [nats], both of the counted lines."""
    x, varies = settled.fit.x, settled.fit.parametrisation
    return settled.error.cost + float(x @ (varies.precision * x)) / 2


def fit_all_lines(
    model: Model,
    campaign: Campaign,
    settled: Fit,
    error: ModelError,
    schedule: FloorSchedule,
    *,
    jobs: int = 1,
    report: Callable[[FitProgress], None] | None = None,
    checkpoint: Checkpoint | None = None,
) -> Fit:
    """Fit all lines at the model-error floor, from the fit to some of them.

    Args:
        campaign, report: as for ``fit_first_stages``.
        settled: fit at its own floor.
        jobs: threads; the result does not depend on it.
    """
    stage = replace(LAST_STAGE, model_error_floor=error.floor, at_bodies=schedule.at_bodies)
    whole = fit(
        model,
        campaign,
        parametrisation=settled.parametrisation,
        starts=(settled.theta,),
        stages=(stage,),
        jobs=jobs,
        report=report,
        checkpoint=checkpoint,
        name="all lines",
    )
    return replace(
        settled,
        x=whole.x,
        cost=whole.cost,
        evaluations=settled.evaluations + whole.evaluations,
        outcome=whole.outcome,
        advice=whole.advice,
        last_stage=stage,
    )


# Largest plausible pull of a tolerance [standard deviations]: in one campaign of 500 the largest of
# 300 tolerances exceeds it by chance.
PLAUSIBLE_PULL_SIGMA = 4.5


def widen_outliers(
    varies: Parametrisation, x: Real, sigma: float = PLAUSIBLE_PULL_SIGMA
) -> Parametrisation | None:
    """Return coordinates in which tolerances at their bounds may shift further; None without any.

    Args:
        varies: coordinates of a fit.
        x: their values at its end; (n_x,).
        sigma: wider bound [standard deviations].
    """
    wide = varies.widen_bounds(varies.coordinates_at_bound(x), sigma)
    has_wider = (wide.lower < varies.lower) | (wide.upper > varies.upper)
    return wide if has_wider.any() else None


def admit_shifts(narrow: Parametrisation, x: Real) -> Parametrisation:
    """Return coordinates in which tolerances that lie beyond their bounds have wider ones.

    Args:
        narrow: coordinates with the usual bounds.
        x: their values at the end of a fit that admitted outliers; (n_x,).
    """
    return narrow.widen_bounds(~narrow.coordinates_within_bounds(x), PLAUSIBLE_PULL_SIGMA)


def are_by_chance(
    narrow: Parametrisation,
    wide: Parametrisation,
    x: Real,
    sigma: float = PLAUSIBLE_PULL_SIGMA,
) -> bool:
    """Return whether tolerances shift beyond their bounds by chance.

    Args:
        narrow: coordinates with the usual bounds.
        wide: coordinates in which outliers may shift further.
        x: their values at the end of a fit; (n_x,).
        sigma: wider bound [standard deviations].
    """
    has_wider = (wide.lower < narrow.lower) | (wide.upper > narrow.upper)
    if (wide.coordinates_at_bound(x) & has_wider).any():
        return False
    shifts = -np.sort(-np.abs(x[wide.is_tolerance]))
    beyond = shifts[shifts >= TOLERANCE_BOUND_SIGMA]
    # Probability of more than k among n shifts, I_p(k + 1, n - k), for k = 0, 1, ...
    count, more = len(shifts), np.arange(len(beyond))
    by_chance = betainc(more + 1, count - more, 2 * ndtr(-beyond))
    return not (by_chance < betainc(1, count, 2 * ndtr(-sigma))).any()
