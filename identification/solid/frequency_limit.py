"""Highest frequency up to which a body moves as a solid: its non-rigid residual along frequency.

With the errors of the sensors fitted, e = P z is what no rigid motion explains. Summed over hits
and over a window of lines as wide as the resonance of a lightly damped mode,

    deviation^2 = (sum |e|^2 - noise) / (sum |z|^2 - noise),

with every channel in units of its noise and every line at its own size. It is the share of the
readings that is not rigid (seed, ch. 2.2, as a number). The part of a flexible motion that looks
like a rigid one does not show: with few redundant channels the deviation is too small.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import gammainccinv

from identification.solid.body_channels import BodyData
from identification.solid.rigid_fit import RigidFitModel
from identification.solid.sensor_faults import BelievedBody
from identification.solid.slope_products import project
from identification.words import Complex, Integers, Mask, Real

# Share of the motion that may be flexible in a body called solid. The tolerances of gain (1 %)
# and angle (1 degree, 1.7 %) allow no better; a smaller share is reported too.
MAX_NONRIGID_SHARE = 0.01
# Probability that noise makes a solid body look flexible, over all lines.
_FALSE_ALARM_PROBABILITY = 1e-3
# Half-width of the window relative to the frequency: two half-power bandwidths of a mode with 1 %
# damping; and its smallest number of lines.
_HALF_WINDOW = 0.02
_MIN_HALF_WINDOW_LINES = 4


@dataclass(frozen=True, eq=False)
class ResidualSpectrum:
    """Residual beside rigid motion, per frequency line; all (n_freq,).

    Args:
        reconstruction: relative difference of readings and their rigid reconstruction, nominal
            sensors, noise included.
        expected: relative difference that noise and tolerances alone would give.
        deviation: relative difference with errors fitted, beyond noise.
        hidden: deviation that the noise would hide.
        excess: residual over noise, errors fitted; noise alone gives 1.
        exceeds_bound: where the deviation significantly exceeds ``MAX_NONRIGID_SHARE``.
        significant: where the deviation significantly exceeds zero.
    """

    reconstruction: Real
    expected: Real
    deviation: Real
    hidden: Real
    excess: Real
    exceeds_bound: Mask
    significant: Mask


def residual_spectrum(
    state: BelievedBody,
    drawn: BelievedBody,
    believed: RigidFitModel,
    errors: Real,
    noise_scale: float,
) -> ResidualSpectrum:
    """Compare residual, noise and tolerances along frequency.

    Args:
        state: the body with exchanges and readings of the accepted faults.
        drawn: the nominal body as measured.
        believed: model with free shapes of the channels that are left out.
        errors: errors of the sensors; (n_error,).
        noise_scale: variance of the noise over the stated one.
    """
    data, freq = state.data, state.data.freq_hz
    reading = state.reading * data.sensors.delay_factor(errors, freq)
    power, noise, square = _residual_powers(data, reading, believed, errors)
    zero = np.zeros_like(errors)
    raw, raw_noise, _ = _residual_powers(drawn.data, drawn.reading, drawn.model, zero)
    total, total_noise = _total_powers(data, reading)
    drawn_total, _ = _total_powers(drawn.data, drawn.reading)
    rigid = np.maximum(total - total_noise, 1e-12 * total.max() + 1e-300)
    residual, residual_noise, motion = (
        np.maximum(_window_mean(x, freq), 0.0) for x in (power, noise_scale * noise, rigid)
    )
    spread = noise_scale**2 * np.maximum(_window_mean(square, freq), 0.0) / _window_lengths(freq)
    hidden = (
        _noise_quantile(residual_noise, spread, _FALSE_ALARM_PROBABILITY / len(freq))
        - residual_noise
    )
    margin = residual - residual_noise - hidden
    drawn_total = np.maximum(drawn_total, 1e-300)
    tolerance_power = _tolerance_power(drawn.data, drawn.model)
    return ResidualSpectrum(
        reconstruction=np.sqrt(np.maximum(raw, 0.0) / drawn_total),
        expected=np.sqrt(np.maximum(noise_scale * raw_noise + tolerance_power, 0.0) / drawn_total),
        deviation=np.sqrt(np.maximum(residual - residual_noise, 0.0) / np.maximum(motion, 1e-300)),
        hidden=np.sqrt(hidden / np.maximum(motion, 1e-300)),
        excess=np.sqrt(residual / np.maximum(_window_mean(noise, freq), 1e-300)),
        exceeds_bound=margin > MAX_NONRIGID_SHARE**2 * motion,
        significant=margin > 0,
    )


def _noise_quantile(mean: Real, variance: Real, chance: float) -> Real:
    """Return the upper quantile of a sum of squares of noise from its mean and variance.

    The sum is taken as gamma distributed (Satterthwaite 1946). If few lines carry the sum, its
    upper tail is far longer than that of a normal distribution.
    """
    known = (mean > 0) & (variance > 0)
    shape = np.where(known, mean, 1.0) ** 2 / np.where(known, variance, 1.0)
    return np.asarray(np.where(known, gammainccinv(shape, chance) * mean / shape, mean), float)


def highest_solid_hz(freq_hz: Real, exceeds_bound: Mask) -> float | None:
    """Return the last line before the first that exceeds the bound.

    Args:
        freq_hz: frequency lines [Hz]; (n_freq,).
        exceeds_bound: where the deviation exceeds the bound; (n_freq,).

    Returns:
        Frequency [Hz]; None if the first line exceeds the bound.
    """
    first = int(np.argmax(exceeds_bound)) if exceeds_bound.any() else len(freq_hz)
    return float(freq_hz[first - 1]) if first else None


def _residual_powers(
    data: BodyData, reading: Complex, model: RigidFitModel, errors: Real
) -> tuple[Real, Real, Real]:
    """Return residual, its noise and the variance of that noise, in units of the readings."""
    power, noise, square = (np.zeros(len(data.freq_hz)) for _ in range(3))
    rows = model.rows(errors) * model.scale[:, None]
    for column, mask in enumerate(data.measured):
        unit = _line_variance(data.line[column])
        projector = project(rows, mask).residual_projector
        residual = (data.white[column] / reading) @ projector
        variance = (
            (data.noise[column] / np.abs(reading) ** 2) @ np.maximum(np.diag(projector), 0.0) * unit
        )
        power += (np.abs(residual) ** 2).sum(axis=1) * unit
        noise += variance
        square += variance**2 / max(np.trace(projector), 1.0)
    return power, noise, square


def _total_powers(data: BodyData, reading: Complex) -> tuple[Real, Real]:
    """Return the power of all readings and that of their noise, per line."""
    unit = _line_variance(data.line)
    total = (np.abs(data.white / reading) ** 2).sum(axis=2) * unit
    noise = (data.noise / np.abs(reading) ** 2).sum(axis=2) * unit
    return total.sum(axis=0), noise.sum(axis=0)


def _tolerance_power(data: BodyData, drawn: RigidFitModel) -> Real:
    """Return the residual of errors within tolerance: sum s_p^2 |P B_p x|^2, without noise."""
    zero = np.zeros(drawn.sensors.count)
    delays = drawn.sensors.delays(drawn.spread)
    rows = drawn.rows(zero) * drawn.scale[:, None]
    slopes = drawn.sensors.slopes(zero) * (drawn.scale[:, None] * drawn.spread[:, None, None])
    total = np.zeros(len(data.freq_hz))
    for column, mask in enumerate(data.measured):
        projection = project(rows, mask)
        projected_slopes = projection.residual_projector @ slopes
        metric = np.einsum("pcq,pcr->qr", projected_slopes, projected_slopes)
        motion = data.white[column] @ projection.inverse.T
        share = np.einsum("fq,qr,fr->f", motion.conj(), metric, motion).real
        share -= data.noise[column] @ np.einsum(
            "qc,qr,rc->c", projection.inverse, metric, projection.inverse
        )
        if delays is not None:
            late = 2 * np.pi * data.freq_hz[:, None] * delays * np.abs(data.white[column])
            share += late**2 @ np.diag(projection.residual_projector)
        total += np.maximum(share, 0.0) * _line_variance(data.line[column])
    return total


def _line_variance(line: Real) -> Real:
    """Return the factor that turns whitened power back into power of the readings of a line."""
    return np.where(line > 0, 1 / np.where(line > 0, line, 1.0) ** 2, 0.0)


def _window_lengths(freq_hz: Real) -> Real:
    """Return the number of lines in the window around each line; (n_freq,)."""
    first, last = _window_edges(freq_hz)
    return (last - first + 1).astype(float)


def _window_mean(values: Real, freq_hz: Real) -> Real:
    """Return the mean over the window around each line; (n_freq,)."""
    first, last = _window_edges(freq_hz)
    total = np.concatenate([[0.0], np.cumsum(values)])
    return np.asarray((total[last + 1] - total[first]) / (last - first + 1), float)


def _window_edges(freq_hz: Real) -> tuple[Integers, Integers]:
    """Return the first and the last line of the window around each line."""
    step = float(np.median(np.diff(freq_hz))) if len(freq_hz) > 1 else 1.0
    half_width = np.maximum(_MIN_HALF_WINDOW_LINES, np.round(_HALF_WINDOW * freq_hz / step)).astype(
        np.intp
    )
    place = np.arange(len(freq_hz))
    return np.maximum(place - half_width, 0), np.minimum(place + half_width, len(freq_hz) - 1)
