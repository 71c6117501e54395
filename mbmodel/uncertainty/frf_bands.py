"""Bands of FRFs between any ports: from the parameters' covariance and the model-error floor.

Let J be the derivatives of an FRF by the coordinates, C their covariance, and u a direction of the
complex plane, |u| = 1. To first order

    var Re(conj(u) H) = a' C a + e^2 D^2 / 2,     a = Re(conj(u) J),

with u = H / |H| for the magnitude and u = i H / |H| for the phase times the magnitude. The first
term is that of ``tuning.assessment.frf_bands``. The second is the model-error floor: the relative
error e of the machine's forces, and D the error of this FRF per unit of it, of
``mbmodel.uncertainty.model_discrepancy``. It is circular.
"""

from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Real
from mbmodel.frf.linearised import Evaluator
from mbmodel.ports.request import FrfRequest
from mbmodel.uncertainty.model_discrepancy import discrepancy_motion
from mbmodel.uncertainty.parameter_posterior import PosteriorOfModel

NORMAL_QUANTILE_95 = 1.959964  # two-sided 95 % quantile of the normal distribution
# 95 % quantile of the Rayleigh distribution, that of a magnitude about zero
_RAYLEIGH_QUANTILE_95 = float(np.sqrt(-2 * np.log(0.05)))
# Part of it that is not along the FRF: both ends of the interval hold 95 %, about zero and far off.
_ACROSS_QUANTILE = float(np.sqrt(_RAYLEIGH_QUANTILE_95**2 - NORMAL_QUANTILE_95**2))
_CHUNK_BYTES = 64 * 2**20  # of derivatives that are held at once


@dataclass(frozen=True, eq=False)
class FrfBands:
    """FRFs with standard deviations.

    Args:
        request: lines, outputs, inputs, quantity.
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
        deviation: Real = np.where(
            size > 0, np.hypot(self.phase, self.model_error) / np.where(size > 0, size, 1.0), np.inf
        )
        return deviation

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
        posterior: of the model.
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
        posterior: of the model.
        thetas: parameters of the samples [SI]; (n_sample, n_theta).
        request: lines, outputs, inputs, quantity.
    """
    evaluator = Evaluator(posterior.model, request)
    shape = (len(thetas), len(request.freq_hz), len(request.outputs), len(request.inputs))
    return np.array([evaluator.at(theta).values for theta in thetas], complex).reshape(shape)
