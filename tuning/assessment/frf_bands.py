"""Standard deviations of predicted FRFs.

Let C be the covariance of the coordinates, J the derivatives of an FRF, and u a direction of the
complex plane, |u| = 1. To first order the FRF's error along u has the variance

    var Re(conj(u) H) = a' C a,   a = Re(conj(u) J).

The directions u = 1 and u = i give the real and imaginary part, u = H / |H| the magnitude.
"""

from collections.abc import Sequence

import numpy as np

from identification.words import Campaign, Complex, Real
from mbmodel import Linearised, Model
from tuning.assessment.parameter_confidence import ParameterConfidence
from tuning.misfit.batch import evaluate_tests, predict
from tuning.misfit.partition import partition_coordinates

_LINES_PER_CHUNK = 16  # limits the memory for derivatives
_MAX_BAND_LINES = 300  # at which deviations are computed; others are interpolated


def frf_deviations(
    lines: Linearised, confidence: ParameterConfidence, directions: Sequence[Complex]
) -> list[Real]:
    """Return standard deviations of all FRFs of a linearised model along some directions.

    Args:
        lines: model at the parameters of ``confidence``.
        directions: u, one array for each direction; (n_freq, n_out, n_in) each.

    Returns:
        One array for each direction; (n_freq, n_out, n_in).
    """
    parametrisation, covariance = confidence.parametrisation, confidence.covariance
    partition = partition_coordinates(lines.model, parametrisation)
    rates = parametrisation.rates(confidence.x)
    forward = lines.sensitivities(partition.shared_parameters, rates, partition.places)
    sensors = list(
        partition.sensor_columns(lines.sensitivities(partition.sensor_parameters), rates)
    )
    if lines.output_factor is not None:
        factor = lines.output_factor.T[:, :, None, None]
        sensors = [
            (rows, values * factor[:, rows], coordinates) for rows, values, coordinates in sensors
        ]
    shared_covariance = covariance[
        np.ix_(partition.shared_coordinates, partition.shared_coordinates)
    ]
    deviations = [np.zeros(lines.values.shape) for _ in directions]
    for start in range(0, len(lines.values), _LINES_PER_CHUNK):
        span = slice(start, start + _LINES_PER_CHUNK)
        columns = forward.columns(span)
        for total, direction in zip(deviations, directions, strict=True):
            shared_slopes = _along(direction[span], columns)
            variance = np.einsum("foms,foms->fom", shared_slopes @ shared_covariance, shared_slopes)
            for rows, values, coordinates in sensors:
                own_slopes = _along(direction[span][:, rows], values[span])
                between = covariance[np.ix_(partition.shared_coordinates, coordinates)]
                inside = covariance[np.ix_(coordinates, coordinates)]
                terms = 2 * (shared_slopes[:, rows] @ between) + own_slopes @ inside
                variance[:, rows] += np.einsum("fomk,fomk->fom", terms, own_slopes)
            total[span] = np.sqrt(np.maximum(variance, 0.0))
    return deviations


def _along(direction: Complex, columns: Complex) -> Real:
    """Return Re(conj(u) J)."""
    return direction.real[..., None] * columns.real + direction.imag[..., None] * columns.imag


def magnitude_deviations(
    model: Model, confidence: ParameterConfidence, campaign: Campaign
) -> tuple[Real, ...]:
    """Return the standard deviation of the magnitude of each test's FRFs, in its labels.

    It is computed at up to 300 lines, between which the relative deviation is interpolated.

    Returns:
        One array for each test; (n_freq, n_out, 1).
    """
    freq, theta = campaign.freq_hz, confidence.parametrisation.theta(confidence.x)
    stride = -(-len(freq) // _MAX_BAND_LINES)
    chosen = np.unique(np.append(np.arange(0, len(freq), stride), len(freq) - 1))

    def relative_deviation(lines: Linearised) -> Complex:
        size = np.maximum(np.abs(lines.values), np.finfo(float).tiny)
        return np.asarray(
            frf_deviations(lines, confidence, [lines.values / size])[0] / size, complex
        )

    by_test = evaluate_tests(model, campaign.select_lines(chosen), relative_deviation, theta)
    position = np.interp(freq, freq[chosen], np.arange(len(chosen)))
    low = np.floor(position).astype(int)
    high, share = np.minimum(low + 1, len(chosen) - 1), (position - low)[:, None, None]
    return tuple(
        np.abs(values) * ((1 - share) * relative.real[low] + share * relative.real[high])
        for values, relative in zip(predict(model, theta, campaign), by_test, strict=True)
    )
