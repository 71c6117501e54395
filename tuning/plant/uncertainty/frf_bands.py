"""Bands of FRFs between any ports: from the parameters' covariance and the model-error floor.

Let J be the derivatives of an FRF by the coordinates, C their covariance, and u a direction of the
complex plane, |u| = 1. To first order

    var Re(conj(u) H) = a' C a + e^2 D^2 / 2,     a = Re(conj(u) J),

with u = H / |H| for the magnitude and u = i H / |H| for the phase times the magnitude. The first
term is that of ``tuning.assessment.frf_bands``. The second is the model-error floor: the relative
error e of the machine's forces, and D the error of this FRF per unit of it, of
``tuning.assessment.model_discrepancy``. It is circular.

A cause whose probability is below one is there, or it is not. Then the density of a magnitude is a
mixture of normal ones, one for each alternative plant,

    P(|H| <= m) = sum_i w_i Phi((m - |H_i|) / s_i),

with the probability w_i of the alternative, its FRF H_i and its standard deviation s_i: below |H_i|
that of the magnitude, above it that which gives the upper end of its own interval. The 2.5 and
97.5 % quantiles are the ends of the interval, found by bisection.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from identification.words import Complex, Real, UsageError
from mbmodel import Evaluator, FrfRequest
from tuning.assessment.model_discrepancy import discrepancy_motion
from tuning.assessment.parameter_confidence import NORMAL_QUANTILE_95
from tuning.assessment.parameter_posterior import PosteriorOfModel

# 95 % quantile of the Rayleigh distribution, that of a magnitude about zero
_RAYLEIGH_QUANTILE_95 = float(np.sqrt(-2 * np.log(0.05)))
# Part of it that is not along the FRF: both ends of the interval hold 95 %, about zero and far off.
_ACROSS_QUANTILE = float(np.sqrt(_RAYLEIGH_QUANTILE_95**2 - NORMAL_QUANTILE_95**2))
_CHUNK_BYTES = 64 * 2**20  # of derivatives that are held at once
_LOW_PROBABILITY, _HIGH_PROBABILITY = 0.025, 0.975
_WIDEST_SIGMA = 10.0  # beyond which no density is left
_BISECTIONS = 60  # each halves the interval: to the rounding of a double


@dataclass(frozen=True, eq=False)
class FrfBands:
    """FRFs with standard deviations.

    Args:
        values: FRFs H of the fitted model; (n_freq, n_out, n_in).
        magnitude: standard deviation of |H| by the parameters; (n_freq, n_out, n_in).
        phase: standard deviation of |H| times the phase by the parameters; (n_freq, n_out, n_in).
        model_error: standard deviation of each by the model-error floor; (n_freq, n_out, n_in).
    """

    request: FrfRequest
    values: Complex
    magnitude: Real
    phase: Real
    model_error: Real

    @property
    def magnitude_deviation(self) -> Real:
        """Standard deviation of |H|; (n_freq, n_out, n_in)."""
        return np.hypot(self.magnitude, self.model_error)

    @property
    def phase_deviation(self) -> Real:
        """Standard deviation of the phase [rad], infinite where H is zero."""
        size = np.abs(self.values)
        return np.where(
            size > 0, np.hypot(self.phase, self.model_error) / np.where(size > 0, size, 1.0), np.inf
        )

    def magnitude_interval(self) -> tuple[Real, Real]:
        """Return both ends of the 95 % interval of |H|; (n_freq, n_out, n_in) each.

        An error across H makes it larger only. So with deviations s along and t across H the upper
        end is the length of (|H| + 1.96 s, 1.47 t): the normal quantile far from zero, and that of
        Rayleigh at an antiresonance.
        """
        size, half = np.abs(self.values), NORMAL_QUANTILE_95 * self.magnitude_deviation
        across = _ACROSS_QUANTILE * np.hypot(self.phase, self.model_error)
        return np.maximum(size - half, 0.0), np.hypot(size + half, across)


def frf_bands(posterior: PosteriorOfModel, request: FrfRequest) -> FrfBands:
    """Return the FRFs between ports with their bands.

    Args:
        request: lines, outputs, inputs, quantity; no output or input need have been measured.
    """
    lines = Evaluator(posterior.model, request).at(posterior.model.drawn)
    values = np.asarray(lines.values)
    sensitivities = lines.sensitivities(posterior.varies, posterior.rates)
    root = posterior.membership @ posterior.posterior.root
    size = np.maximum(np.abs(values), np.finfo(float).tiny)
    direction = np.where(values == 0, 1.0, values / size)
    magnitude, phase = np.zeros(values.shape), np.zeros(values.shape)
    step = max(1, _CHUNK_BYTES // (16 * values[0].size * max(root.shape[0], 1)))
    for start in range(0, len(values), step):
        span = slice(start, start + step)
        columns = sensitivities.columns(span) @ root
        along = direction[span, ..., None].conj() * columns
        magnitude[span] = np.linalg.norm(along.real, axis=-1)
        phase[span] = np.linalg.norm(along.imag, axis=-1)
    model_error = posterior.posterior.discrepancy / np.sqrt(2) * discrepancy_motion(lines)
    return FrfBands(request, values, magnitude, phase, model_error)


def sample_frfs(posterior: PosteriorOfModel, thetas: Real, request: FrfRequest) -> Complex:
    """Return the FRFs of samples; (n_sample, n_freq, n_out, n_in).

    Args:
        thetas: parameters of the samples [SI]; (n_sample, n_theta).
    """
    evaluator = Evaluator(posterior.model, request)
    shape = (len(thetas), len(request.freq_hz), len(request.outputs), len(request.inputs))
    return np.array([evaluator.at(theta).values for theta in thetas], complex).reshape(shape)


@dataclass(frozen=True, eq=False)
class AlternativePlants:
    """Plants of which one is true.

    Args:
        names: of the alternatives; n.
        weights: probability of each, of sum one; (n,).
        bands: FRFs of each with their deviations, of one request; n.
    """

    names: tuple[str, ...]
    weights: Real
    bands: tuple[FrfBands, ...]

    def __post_init__(self) -> None:
        """Check that the weights are probabilities."""
        if len(self.weights) != len(self.bands) or not np.isclose(self.weights.sum(), 1):
            raise UsageError("the weights of alternative plants must be probabilities of sum one")

    def magnitude_interval(self) -> tuple[Real, Real]:
        """Return both ends of the 95 % interval of |H|; (n_freq, n_out, n_in) each."""
        sizes = np.array([np.abs(band.values) for band in self.bands])
        below = np.array([band.magnitude_deviation for band in self.bands])
        upper = np.array([band.magnitude_interval()[1] for band in self.bands])
        above = (upper - sizes) / NORMAL_QUANTILE_95
        return (
            self._quantile(sizes, below, above, _LOW_PROBABILITY),
            self._quantile(sizes, below, above, _HIGH_PROBABILITY),
        )

    def _quantile(self, sizes: Real, below: Real, above: Real, probability: float) -> Real:
        """Return a quantile of the mixture, at least zero."""
        low = (sizes - _WIDEST_SIGMA * below).min(axis=0)
        high = (sizes + _WIDEST_SIGMA * above).max(axis=0)
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2
            units = np.maximum(np.where(middle < sizes, below, above), np.finfo(float).tiny)
            with np.errstate(over="ignore"):
                share = np.tensordot(self.weights, ndtr((middle - sizes) / units), 1)
            low = np.where(share < probability, middle, low)
            high = np.where(share < probability, high, middle)
        return np.maximum((low + high) / 2, 0.0)
