r"""Confidence in a plant: covariance of the parameters where the model lacks something.

A fit follows what its model lacks, so that its parameters and its FRFs between other ports are off
by more than the noise explains. The residuals show by how much. With the discrepancy of
``tuning.assessment.model_discrepancy``, of variance e^2 D^2, a residual has the variance

    T = var + e^2 D^2,

and e maximises the likelihood of circular complex normal residuals. It is one error for the whole
machine, so that FRFs that were not measured have it too. Errors are shared between lines and
channels: n values hold N_eff = k n independent ones (``residual_statistics``). Of these the fit has
followed p = tr[C N k / s^2], so that

    e^2 = e_residual^2 N_eff / (N_eff - p),

as a variance about p fitted parameters. The estimate minimises sum w |r|^2 + prior, with the
weights w of the noise. Its error has the covariance (White 1982, Econometrica 50, 1-25)

    C = A^-1 (B + D) A^-1,    A = N + D,    B = 2 Re sum w^2 T conj(dH) dH / k,

with N the normal equations and D the precision of the priors. For T = 1 / w and k = 1 it is A^-1.
To first order it knows no bounds, so that it is limited to the prior in every direction.
"""

from dataclasses import dataclass

import numpy as np

from identification.words import Campaign, Complex, Mask, Real
from mbmodel import Model
from tuning.assessment.model_discrepancy import discrepancy_motion
from tuning.assessment.parameter_confidence import ParameterConfidence, bound_covariance
from tuning.fitting.fitter import Fit
from tuning.fitting.stage_search import LAST_STAGE, Stage
from tuning.misfit.misfit import Misfit
from tuning.misfit.residual_statistics import floor_cost, independent_share, profile_floor


@dataclass(frozen=True)
class DiscrepancySettings:
    """Constants of the estimate.

    Args:
        smallest: relative error of forces below which none is sought: rounding.
        largest: relative error beyond which a model tells nothing.
        log_step: to which the logarithm of the error is found.
        min_gain_nats: gain in log likelihood, of the independent values, from which an error is
            taken as seen: 95 % of models without any gain less.
        max_absorbed_factor: of the variance, for what a fit has followed. The number of
            independent values is known to such a factor only.
    """

    smallest: float = 1e-8
    largest: float = 1.0
    log_step: float = 1e-3
    min_gain_nats: float = 2.0
    max_absorbed_factor: float = 4.0


SETTINGS = DiscrepancySettings()


@dataclass(frozen=True, eq=False)
class PlantConfidence:
    """Confidence in a plant.

    Args:
        covariance: C of the coordinates; (n_x, n_x).
        discrepancy: e, relative error of the machine's forces; 0 if the residuals show none.
    """

    covariance: Real
    discrepancy: float


@dataclass(frozen=True, eq=False)
class _Residuals:
    """Residuals of one batch, with variances, D^2 and weights; (n_freq, n_out, n_test) each."""

    residual: Complex
    variance: Real
    power: Real
    weight: Real

    @property
    def counts(self) -> Mask:
        """Whether each value counts."""
        return (self.weight > 0) & (self.power > 0) & (self.variance > 0)

    def independent_values(self, error: float) -> float:
        """Return the number of independent values beside a discrepancy."""
        total = np.where(self.counts, self.variance + error**2 * self.power, 1.0)
        unit = np.where(self.counts, self.residual / np.sqrt(total), 0.0)
        for axis in range(unit.ndim):  # silent lines and channels hold no value
            other_axes = tuple(k for k in range(unit.ndim) if k != axis)
            unit = np.compress(self.counts.any(axis=other_axes), unit, axis=axis)
        return min(1.0, independent_share(unit)) * float(self.counts.sum())


def estimate_plant_confidence(
    model: Model, campaign: Campaign, fit: Fit, confidence: ParameterConfidence, jobs: int = 1
) -> PlantConfidence:
    """Estimate the discrepancy of a fitted model, and its parameters' covariance beside it.

    Args:
        confidence: of its parameters, from the noise alone.
        jobs: threads; the result does not depend on it.
    """
    last = fit.last_stage or LAST_STAGE
    misfit = Stage(last.model_error_floor, logarithmic=False).build_misfit(
        model, campaign, fit.parametrisation, threads=jobs
    )
    batches = _residuals(misfit, fit.theta)
    values = sum(int(batch.counts.sum()) for batch in batches)
    error, gain = _largest_likelihood(batches) if values else (0.0, 0.0)
    independent = sum(batch.independent_values(error) for batch in batches)
    if gain * independent <= SETTINGS.min_gain_nats * values:
        return PlantConfidence(confidence.covariance, 0.0)
    share = independent / values
    variance = error**2 * _absorbed_factor(confidence, independent, share)
    spread = misfit.with_weights(
        [batch.weight**2 * (batch.variance + variance * batch.power) for batch in batches]
    )
    _, _, normal = misfit.quadratic_model(fit.x)
    _, _, spread_normal = spread.quadratic_model(fit.x)
    prior = np.diag(confidence.prior_precision)
    inverse = _invert(normal.dense() + prior)
    free = inverse @ (spread_normal.dense() / share + prior) @ inverse
    covariance = bound_covariance(free, 1 / confidence.prior_precision)
    return PlantConfidence(covariance, float(np.sqrt(variance)))


def _invert(matrix: Real) -> Real:
    """Return the inverse of a symmetric positive definite matrix, scaled to a unit diagonal."""
    scale = 1 / np.sqrt(np.diag(matrix))
    inverse: Real = np.linalg.inv(matrix * np.outer(scale, scale)) * np.outer(scale, scale)
    return (inverse + inverse.T) / 2


def _residuals(misfit: Misfit, theta: Real) -> list[_Residuals]:
    """Return the residuals of each batch."""
    batches = []
    for weighted in misfit.batches:
        batch = weighted.batch
        lines = batch.evaluator.at(theta)
        deviation = batch.select_inputs(discrepancy_motion(lines).astype(complex)).real
        residual = np.where(
            weighted.weight > 0, batch.select_inputs(lines.values) - batch.values, 0.0
        )
        batches.append(_Residuals(residual, batch.variance, deviation**2, weighted.weight))
    return batches


def _largest_likelihood(batches: list[_Residuals]) -> tuple[float, float]:
    """Return e of the residuals alone, and its gain in log likelihood over none [nats]."""
    squares, variance, power = (
        np.concatenate(
            [values[batch.counts] for values, batch in zip(arrays, batches, strict=True)]
        )
        for arrays in (
            [np.abs(batch.residual) ** 2 for batch in batches],
            [batch.variance for batch in batches],
            [batch.power for batch in batches],
        )
    )
    bounds = SETTINGS.smallest, SETTINGS.largest
    error = profile_floor(squares, variance, power, bounds, SETTINGS.log_step)
    without = floor_cost(float(np.log(SETTINGS.smallest)), squares, variance, power)
    return error.floor, without - error.cost


def _absorbed_factor(confidence: ParameterConfidence, independent: float, share: float) -> float:
    """Return N_eff / (N_eff - p), at most the largest factor."""
    information = share / confidence.variance_inflation * confidence.normal.dense()
    precision = information + np.diag(confidence.prior_precision)
    followed = float(np.trace(np.linalg.solve(precision, information)))
    factor = SETTINGS.max_absorbed_factor
    return min(factor, independent / max(independent - followed, independent / factor))
