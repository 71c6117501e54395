"""Model error: the relative error of the model that its residuals show beside the noise.

A model of a real machine is never exact. Its error is taken as proportional to the motion of the
sensor's point, so that a residual has the variance

    E|r|^2 = var + a^2 |H_point|^2,

var being that of the noise, smooth along frequency as in the weights of a fit, and |H_point|^2 the
sum over the directions measured at the point. The floor a maximises the likelihood of circular
complex normal residuals,

    ln L(a) = - sum [ |r|^2 / (var + a^2 |H_point|^2) + ln(var + a^2 |H_point|^2) ],

for which a large floor pays by its logarithm. With parameters fitted at that floor, and the floor
estimated anew, this is empirical Bayes (type II maximum likelihood; Kennedy and O'Hagan 2001 call
the error model discrepancy).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from identification import smooth_variance
from identification.words import Campaign, Complex, FrfEstimate, Mask, Real
from tuning.misfit.weights import FORCE_ERROR_FLOOR, point_power_of, squared_size

_LARGEST_ERROR = 3.0  # relative: a model that is off by more tells nothing
_LOG_STEP = 1e-3  # of the floor, to which its logarithm is found


@dataclass(frozen=True)
class ModelError:
    """Relative error of a model, estimated from residuals.

    Args:
        floor: a, relative to the motion of each point; not below the force sensor's error.
        cost: -ln L at the floor [nats], but for a constant.
        values: number of residuals.
    """

    floor: float
    cost: float
    values: int

    @property
    def is_at_force_error(self) -> bool:
        """Whether no more error is seen than that of a force sensor."""
        return self.floor <= FORCE_ERROR_FLOOR * (1 + 2 * _LOG_STEP)


def estimate_model_error(predicted: Sequence[Complex], campaign: Campaign) -> ModelError | None:
    """Estimate the relative error of the model that made these predictions.

    Args:
        predicted: the model's answer to each test in its labels; (n_freq, n_out, 1) each.
        campaign: measurements.

    Returns:
        The error; None where no channel moves.
    """
    rows = [
        _residual_rows(model, test.estimate)
        for model, test in zip(predicted, campaign.tests, strict=True)
    ]
    squares, variance, power = (np.concatenate(parts) for parts in zip(*rows, strict=True))
    if not len(squares):
        return None
    return profile_floor(squares, variance, power)


def profile_floor(squares: Real, variance: Real, power: Real) -> ModelError:
    """Return the floor of largest likelihood.

    Args:
        squares: |r|^2 of each value; (n_value,).
        variance: var of each; (n_value,).
        power: |H_point|^2 of each, above zero; (n_value,).
    """

    def cost(log_floor: float) -> float:
        total = variance + np.exp(2 * log_floor) * power
        return float(np.sum(squares / total + np.log(total)))

    bounds = np.log(FORCE_ERROR_FLOOR), np.log(_LARGEST_ERROR)
    minimum = minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": _LOG_STEP})
    return ModelError(float(np.exp(minimum.x)), float(minimum.fun), len(squares))


def find_counted_values(estimate: FrfEstimate) -> tuple[Mask, Real]:
    """Return which values of a test count, and |H_point|^2; (n_freq, n_out, 1) each.

    Channels that were not measured or read nothing do not count.

    Args:
        estimate: FRFs of the test.
    """
    power = point_power_of(estimate.frf.values, estimate.frf.outputs)
    counts: Mask = estimate.measured & ~estimate.reads_zero & (power > 0)
    return counts, power


def _residual_rows(model: Complex, estimate: FrfEstimate) -> tuple[Real, Real, Real]:
    """Return |r|^2, var and |H_point|^2 of the values of one test that count; (n_value,) each."""
    counts, power = find_counted_values(estimate)
    residual = squared_size(model - estimate.frf.values)
    return residual[counts], smooth_variance(estimate)[counts], power[counts]
