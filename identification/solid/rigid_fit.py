"""Fit of sensor errors with all rigid motions projected out and tolerances as priors.

With z the whitened channels of a line and a hit, B(p) the whitened rows and x free,

    min_x |z - B x|^2 = z^H P z,   P = 1 - B B^+,

and its sum over lines and hits is tr(P G), G = sum Re(z z^H): a fit needs only one small matrix per
block of lines. Noise alone gives tr(P V), V its diagonal. So tr(P (G - V)) is not biased by noise,
however weights were chosen (errors in variables with known noise; Fuller 1987, ch. 2). One unit is
one nat: z has the density exp(-|z - B x|^2). Delays tau among the errors are removed from z first:
z^H P z becomes y^H P y with y = exp(i w tau) z, which ``DelayedSums`` sums.
"""

from dataclasses import dataclass

import numpy as np

from identification.solid.moments import FitSums, Moments
from identification.solid.sensor_errors import Sensors
from identification.solid.slope_products import Projection, SlopeProducts, project, solve_definite
from identification.words import Real

_MAX_FIT_STEPS = 8  # Gauss-Newton steps
_MAX_SHORTENINGS = 6  # trials of a step that does not lower the cost
_MIN_SHORTENING = 0.1  # smallest factor by which such a step is shortened
# Standard deviations by which the residual of noise alone may lie below its mean.
_CHANCE_SIGMA = 3.0
_MIN_WEIGHT, _WEIGHT_STEP = 1e-4, 0.3  # of the data, and the accuracy of its logarithm
_MIN_DECREASE_NATS = 1e-2  # decrease of the cost below which a fit has converged [nats]


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Cost of the data at some errors, with what its slopes need.

    Args:
        errors: p; (n_error,).
        projections: projection of each group.
        clean: G - V of each group without the delays in p; (n_group, n_channel, n_channel).
        data: tr(P (G - V)) [nats beyond noise].
    """

    errors: Real
    projections: tuple[Projection, ...]
    clean: Real
    data: float


@dataclass(frozen=True, eq=False)
class FittedErrors:
    """Fitted errors of sensors and their cost.

    Args:
        errors: p; (n_error,).
        data: tr(P (G - V)) [nats beyond noise].
        prior: half the sum of squares of p over its spread, released ones left out [nats].
        information: N of the last step, the data's part of the curvature; (n_error, n_error).
    """

    errors: Real
    data: float
    prior: float
    information: Real


@dataclass(frozen=True, eq=False)
class RigidFitModel:
    """Model of a body's channels: rigid motions, errors of sensors and free shapes.

    Args:
        sensors: nominal places and axes.
        scale: 1 / noise of each channel; (n_channel,).
        spread: prior standard deviation of each error; (n_error,).
        extra: shapes of other motions with free amplitude, as columns; (n_channel, n).
    """

    sensors: Sensors
    scale: Real
    spread: Real
    extra: Real

    def rows(self, errors: Real) -> Real:
        """Return rigid motions and extra shapes as columns; (n_channel, 6 + n)."""
        return np.hstack([self.sensors.rows(errors), self.extra])

    def data(self, moments: Moments, errors: Real) -> float:
        """Compute tr(P (G - V)) over all groups and blocks of the moments."""
        return self.evaluate(moments.fit_sums(), errors).data

    def slopes(self, moments: Moments, errors: Real) -> tuple[Real, Real]:
        """Compute the gradient of ``data``, (n_error,), and N, half its Gauss-Newton curvature."""
        sums = moments.fit_sums()
        return self.slopes_at(sums, self.evaluate(sums, errors))

    def evaluate(self, sums: FitSums, errors: Real) -> Evaluation:
        """Compute tr(P (G - V)) over all groups, and the projections that it needs."""
        rows = self.rows(errors) * self.scale[:, None]
        projections = tuple(project(rows, mask) for mask in sums.mask)
        clean = sums.clean(self.sensors.delays(errors))
        data = sum(
            float(np.vdot(projection.residual_projector, group))
            for projection, group in zip(projections, clean, strict=True)
        )
        return Evaluation(errors, projections, clean, data)

    def slopes_at(self, sums: FitSums, evaluation: Evaluation) -> tuple[Real, Real]:
        """Compute the gradient of ``data`` and N from the projections of an evaluation."""
        errors = evaluation.errors
        entries = self.sensors.slope_entries(errors)
        products = SlopeProducts(entries, self.scale, len(errors))
        delayed = sums.delay_sums(self.sensors.delays(errors))
        gradient, information = np.zeros(len(errors)), np.zeros((len(errors), len(errors)))
        for group, projection in enumerate(evaluation.projections):
            late = None if delayed is None else (delayed[0][group], delayed[1][group])
            products.add_to(gradient, information, projection, evaluation.clean[group], late)
        return gradient, information


def fit_errors(
    model: RigidFitModel,
    moments: Moments,
    *,
    start: Real | None = None,
    steps: int = _MAX_FIT_STEPS,
    least: float | None = None,
) -> FittedErrors:
    """Minimise the cost over the errors: data + p^2 / (2 spread^2), by damped Gauss-Newton steps.

    Where that leaves less than the noise, the least p^2 is sought that leaves as much as the noise
    (the discrepancy principle; Morozov 1966): the data then count less. Stated noise may be more
    than redundant channels show, since hits beside their place scatter all channels together, as a
    motion of the solid. Fitted below the true noise, errors would follow what is stated too high.

    Args:
        model: sensors, priors and free shapes.
        start: errors at the start, zero if None; (n_error,).
        steps: number of steps, at most.
        least: cost of the data that the noise leaves; what it leaves by chance if None.
    """
    sums, least = moments.fit_sums(), min_data(moments) if least is None else least
    at = model.evaluate(sums, np.zeros(model.sensors.count) if start is None else start)
    fitted = _fit_weighted(model, sums, at, steps, 1.0)
    low, high = np.log(_MIN_WEIGHT), 0.0
    while fitted.data < least and high - low > _WEIGHT_STEP:
        middle = (low + high) / 2
        at = model.evaluate(sums, fitted.errors)
        trial = _fit_weighted(model, sums, at, steps, float(np.exp(middle)))
        if trial.data < least:
            fitted, high = trial, middle
        else:
            low = middle
    return fitted


def min_data(moments: Moments) -> float:
    """Return the cost of the data that noise leaves by chance, at least; see ``fit_errors``."""
    return -_CHANCE_SIGMA * float(np.sqrt(moments.noise.sum()))


def _fit_weighted(
    model: RigidFitModel, sums: FitSums, at: Evaluation, steps: int, weight: float
) -> FittedErrors:
    """Minimise weight data + p^2 / (2 spread^2).

    A step that does not lower the cost is shortened to the minimum of the parabola through cost,
    slope and trial (Dennis and Schnabel 1983, ch. 6.3). The fit ends where the step promises less
    than a hundredth of a nat.
    """
    precision = 1 / model.spread**2
    prior = 0.5 * float(precision @ at.errors**2)
    information = np.zeros((len(at.errors), len(at.errors)))
    for _ in range(steps):
        gradient, information = model.slopes_at(sums, at)
        # In units of the spread the curvature is at least one, so that the solution is stable.
        scaled = 2 * weight * information * np.outer(model.spread, model.spread)
        slope = (weight * gradient + precision * at.errors) * model.spread
        step = solve_definite(scaled + np.eye(len(scaled)), slope)
        descent, length, before = float(slope @ step), 1.0, weight * at.data + prior
        change = -np.asarray(step * model.spread, float)
        for _ in range(_MAX_SHORTENINGS):
            if 0.5 * descent * length < _MIN_DECREASE_NATS:
                break
            trial = model.evaluate(sums, model.sensors.step(at.errors, length * change))
            trial_prior = 0.5 * float(precision @ trial.errors**2)
            excess = weight * trial.data + trial_prior - before
            if excess < 0:
                at, prior = trial, trial_prior
                break
            shorter = 0.5 * descent * length / (excess + descent * length)
            length *= max(shorter, _MIN_SHORTENING)
        if before - weight * at.data - prior < _MIN_DECREASE_NATS:
            break
    return FittedErrors(at.errors, at.data, prior, information)
