"""Fit at the error that the model of this machine has: parameters and floor in turn.

A fit at the weights of the noise goes down to errors that no real model has: its landscape is full
of minima there, and any imperfection is significant. So the fit tolerates the error that its own
residuals show (``tuning.misfit.residual_statistics``), and both are estimated in turn until the
floor stays. A model that is exact but for noise ends at the force sensor's error, that is at the
noise.
"""

from dataclasses import dataclass, replace

import numpy as np

from identification.words import Campaign, Real
from mbmodel import Model
from tuning.fitting.fitter import Fit, fit
from tuning.fitting.stage_search import STAGES, Stage, thin_lines
from tuning.misfit.batch import predict
from tuning.misfit.residual_statistics import ModelError, estimate_model_error
from tuning.parametrisation.parametrisation import Parametrisation


@dataclass(frozen=True)
class FloorSchedule:
    """Constants of the fits in turn.

    Args:
        stride: every n-th frequency line counts.
        max_steps: Gauss-Newton steps of each fit.
        max_turns: fits at most.
        max_rise: factor by which the floor may rise in a turn. A fit that began too low is led back
            without losing its way.
        min_change: relative change of the floor at which the turns end.
        first_stride_factor: factor on the strides of the stages before the first fit at a floor,
            above 1 for large campaigns, whose later fits count fewer lines too.
        enough_values: FRF values that a fit needs: 3 directions, 69 channels and 850 lines. A
            campaign with more is fitted to every second or third of the usual lines.
        min_fitted_lines: lines that a fit counts at least, of a campaign that has them: 800 lines
            at a stride of 8.
        at_bodies: whether differences count at the centres of mass instead of the channels.
    """

    stride: int = 8
    max_steps: int = 6
    max_turns: int = 4
    max_rise: float = 1.5
    min_change: float = 0.05
    first_stride_factor: int = 1
    enough_values: int = 180_000
    min_fitted_lines: int = 96
    at_bodies: bool = False

    def stage(self, floor: float) -> Stage:
        """Return the stage of a fit at a floor."""
        return replace(
            STAGES[3],
            model_error_floor=floor,
            stride=self.stride,
            max_steps=self.max_steps,
            at_bodies=self.at_bodies,
        )

    def find_stride_factor(self, campaign: Campaign) -> int:
        """Return the factor on the strides of a campaign's lines, above 1 for large ones."""
        return max(1, round(count_measured_values(campaign) / self.enough_values))

    def thin(self, lines: int, stride_factor: int) -> "FloorSchedule":
        """Return the schedule for a number of lines.

        Enough lines count to show sharp modes. At least every second line is left out, by which
        neighbouring lines show a gap.

        Args:
            lines: number of frequency lines.
            stride_factor: factor on the strides (``find_stride_factor``).
        """
        stride = max(2, min(self.stride * stride_factor, lines // self.min_fitted_lines))
        first = self.first_stride_factor * max(1, stride // self.stride)
        return replace(self, stride=stride, first_stride_factor=first)


@dataclass(frozen=True, eq=False)
class FloorFit:
    """A fit at its own floor.

    Args:
        fit: parameters at the last floor.
        error: model error that its residuals show.
        is_settled: whether the floor stayed within the last turn.
    """

    fit: Fit
    error: ModelError
    is_settled: bool


def count_measured_frfs(campaign: Campaign) -> int:
    """Return the number of FRFs."""
    return sum(int(test.estimate.measured.sum()) for test in campaign.tests)


def count_measured_values(campaign: Campaign) -> int:
    """Return the number of values, about the cost of a fit that leaves noise alone [nats]."""
    return count_measured_frfs(campaign) * len(campaign.freq_hz)


def fit_at_error_floor(
    model: Model,
    campaign: Campaign,
    parametrisation: Parametrisation,
    *,
    start: Real | None = None,
    first_stages: tuple[Stage, ...] = (),
    floor: float = STAGES[2].model_error_floor,
    schedule: FloorSchedule | None = None,
    jobs: int = 1,
) -> FloorFit:
    """Fit parameters and the floor of the model's error in turn.

    Args:
        start: theta [SI]; None for the nominal model, from which the fit goes by the logarithm of
            the FRFs first.
        first_stages: stages before the first fit at a floor, from the given start.
        floor: relative error that the first fit tolerates; at most that which ``first_stages``
            leave.
        schedule: constants; the usual ones if None.
        jobs: threads; the result does not depend on it.

    Raises:
        KeyboardInterrupt: interrupted.
        ValueError: no channel moves, or the schedule has no turn.
    """
    schedule = schedule or FloorSchedule()
    stages = tuple(
        replace(stage, stride=stage.stride * schedule.first_stride_factor)
        for stage in (STAGES[:3] if start is None else first_stages)
    )
    theta = start
    counted = thin_lines(campaign, schedule.stride // 2)

    def fit_stages(*stages: Stage) -> Fit:
        reached = fit(
            model,
            campaign,
            parametrisation=parametrisation,
            starts=None if theta is None else (theta,),
            stages=stages,
            jobs=jobs,
        )
        if reached.outcome == "interrupted":
            raise KeyboardInterrupt
        return reached

    if start is not None and stages:
        theta = fit_stages(*stages).theta
        error = estimate_model_error(predict(model, theta, counted), counted)
        stages, floor = (), floor if error is None else min(floor, error.floor)
    for turn in range(1, schedule.max_turns + 1):
        current = fit_stages(*stages, schedule.stage(floor))
        theta, stages = current.theta, ()
        error = estimate_model_error(predict(model, theta, counted), counted)
        if error is None:
            raise ValueError("no channel moves, so that no model error shows")
        is_settled = abs(float(np.log(error.floor / floor))) < schedule.min_change
        if is_settled or turn == schedule.max_turns:
            return FloorFit(current, error, is_settled)
        floor = min(error.floor, schedule.max_rise * floor)
    raise ValueError("a schedule needs at least one turn")
