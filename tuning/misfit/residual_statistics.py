r"""Statistics of a residual: model error, noise share, and how many independent values it holds.

Errors of a model are shared: neighbouring lines within a resonance, the channels of a body and the
directions of a hammer carry the same error. Evidence counts independent values. With the residual
u of unit variance, arranged along lines f, channels c and tests t, its Gram matrix along each axis
has a participation ratio

    d = (tr C)^2 / tr C^2,        N_eff = n (d_f d_c d_t) / (d_f d_c d_t of white noise),

which is the number of independent values where all have the same variance (Satterthwaite 1946). It
is one for a residual of a single shape. White noise of m columns has d = n m / (n + m) along an
axis of n rows, since a Gram matrix is estimated from finite data, so that its N_eff is n.

Model error: the relative error of the model that its residuals show beside the noise.

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


@dataclass(frozen=True)
class ResidualStatistics:
    """Residual of a fit beside noise and model error.

    Args:
        floor: relative model error a of largest likelihood.
        cost: -ln L at that floor, mean of all values [nats].
        values: number of values.
        chi_square: mean of |r|^2 / (var + a_0^2 |H_point|^2), a_0 the least relative error of any
            line (``FORCE_ERROR_FLOOR``); 1 for noise alone.
        noise_share: mean share of the noise in the variance var + a^2 |H_point|^2.
        effective_values: number of independent values.
    """

    floor: float
    cost: float
    values: int
    chi_square: float
    noise_share: float
    effective_values: float


def residual_statistics(
    predicted: Sequence[Complex], campaign: Campaign
) -> ResidualStatistics | None:
    """Return the statistics of a residual; None where no channel moves.

    Args:
        predicted: the model's answer to each test in its labels; (n_freq, n_out, 1) each.
    """
    outputs = {dof: row for row, dof in enumerate(campaign.outputs)}
    shape = (len(outputs), len(campaign.tests), len(campaign.freq_hz))
    residual, variance, power = np.zeros(shape, complex), np.ones(shape), np.zeros(shape)
    for column, (model, test) in enumerate(zip(predicted, campaign.tests, strict=True)):
        estimate = test.estimate
        dofs = estimate.frf.outputs
        rows = [outputs[dof.positive] for dof in dofs]
        values = estimate.frf.values[:, :, 0].T
        counts = (estimate.measured & ~estimate.reads_zero)[:, 0, None]
        residual[rows, column] = np.where(counts, model[:, :, 0].T - values, 0.0)
        variance[rows, column] = smooth_variance(estimate)[:, :, 0].T
        point_power = point_power_of(estimate.frf.values, dofs)[:, :, 0].T
        power[rows, column] = np.where(counts, point_power, 0.0)
    counted = power > 0
    if not counted.any():
        return None
    of_counted = residual[counted], variance[counted], power[counted]
    counted_residual, counted_variance, counted_power = of_counted
    squares = squared_size(counted_residual)
    error = profile_floor(squares, counted_variance, counted_power)
    least = counted_variance + FORCE_ERROR_FLOOR**2 * counted_power
    total = counted_variance + error.floor**2 * counted_power
    unit = np.zeros(shape, complex)
    unit[counted] = counted_residual / np.sqrt(total)
    return ResidualStatistics(
        floor=error.floor,
        cost=error.cost / error.values,
        values=error.values,
        chi_square=float(np.mean(squares / least)),
        noise_share=float(np.mean(counted_variance / total)),
        effective_values=max(1.0, min(1.0, independent_share(unit)) * error.values),
    )


def independent_share(unit: Complex) -> float:
    """Return the product of participation ratios along each axis, relative to white noise.

    Args:
        unit: residual of unit variance, zero where it does not count; an axis each for channels,
            tests and lines, in any order.
    """
    share, trace = 1.0, float(squared_size(unit).sum())
    for axis in range(unit.ndim if trace > 0 else 0):
        rows = np.moveaxis(unit, axis, 0).reshape(unit.shape[axis], -1)
        count, columns = rows.shape
        filled = rows[:, rows.any(axis=0)]
        gram = squared_size(filled @ filled.conj().T)
        white = count * columns / (count + columns)
        share *= trace**2 / float(gram.sum()) / white
    return share


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


def profile_floor(
    squares: Real,
    variance: Real,
    power: Real,
    bounds: tuple[float, float] = (FORCE_ERROR_FLOOR, _LARGEST_ERROR),
    log_step: float = _LOG_STEP,
) -> ModelError:
    """Return the floor of largest likelihood.

    Args:
        squares: |r|^2 of each value; (n_value,).
        variance: var of each; (n_value,).
        power: |H_point|^2 of each, above zero; (n_value,).
        bounds: smallest and largest floor.
        log_step: error of its logarithm.
    """
    minimum = minimize_scalar(
        floor_cost,
        args=(squares, variance, power),
        bounds=np.log(bounds),
        method="bounded",
        options={"xatol": log_step},
    )
    return ModelError(float(np.exp(minimum.x)), float(minimum.fun), len(squares))


def floor_cost(log_floor: float, squares: Real, variance: Real, power: Real) -> float:
    """Return -ln L of a floor a [nats], but for constants: sum |r|^2 / v + ln v, v = var + a^2 p.

    Args:
        log_floor: ln a.
        squares, variance, power: as for ``profile_floor``.
    """
    total = variance + np.exp(2 * log_floor) * power
    return float(np.sum(squares / total + np.log(total)))


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
