"""Comparison of identified modes with single-mode methods, in channels that one mode dominates."""

from dataclasses import dataclass

import numpy as np

from identification.modal.campaign_modes import MeasuredFrfs
from identification.modal.circle_fit_method import Circle, circle_fit
from identification.modal.half_power_method import (
    half_power_damping,
    least_squares_amplitude,
    peak_amplitude,
    relative_difference,
    unit_response,
)
from identification.words import Complex, InputError, Integers, ModalModel, Real, modal_sum

# Response of everything else over that of the mode, at most, on all lines of its half-power band.
_MAX_OTHER_RESPONSE = 0.3
# Standard deviation of a line over the response of the mode, at most.
_MAX_RELATIVE_NOISE = 0.05
# Half-width of the band of a circle fit over zeta f_r: 1.5 half-power bandwidths in all.
_CIRCLE_HALF_WIDTH = 1.5
# Lines in the half-power band below which the single-mode methods are not used.
_MIN_HALF_POWER_LINES = 5
# Channels, the strongest, to which a circle is fitted.
_MAX_CIRCLES = 12


@dataclass(frozen=True, eq=False)
class SingleModeCheck:
    """One identified mode, and what the single-mode methods give; None where they give nothing.

    A channel is an (output, input) pair in which the mode dominates the FRF over its half-power
    band. The damping of an exponential window is removed.

    Args:
        freq_hz, damping: identified natural frequency and damping ratio [Hz, 1].
        channels: numbers of output and input; (n_channel, 2).
        half_power_damping: median of eq. 16 over the channels that fall by 3 dB on both sides.
        half_power_channels: number of these channels.
        circle_freq_hz, circle_damping: medians of the circles of the strongest channels [Hz, 1].
        circle_channels: number of circles that could be fitted.
        least_squares: C of each channel by eq. 18, signed; (n_channel,).
        peak: C of each channel from the value at resonance, signed; (n_channel,).
        amplitude_difference: median of the relative difference of both amplitudes, as in table 3.
        reason: why a result is missing; empty if none is.
    """

    freq_hz: float
    damping: float
    channels: Integers
    half_power_damping: float | None
    half_power_channels: int
    circle_freq_hz: float | None
    circle_damping: float | None
    circle_channels: int
    least_squares: Real
    peak: Real
    amplitude_difference: float | None
    reason: str


def check_single_modes(measured: MeasuredFrfs, model: ModalModel) -> tuple[SingleModeCheck, ...]:
    """Apply half-power damping, circle fit and both amplitudes to every mode inside the band.

    Args:
        measured: FRFs from which the modes were identified.
        model: the modes, including those beside the band.

    Returns:
        One entry a mode inside the band, in the order of the model.
    """
    lowest, highest = measured.freq_hz[[0, -1]]
    inside = (model.freq_hz >= lowest) & (model.freq_hz <= highest)
    return tuple(_check_mode(measured, model, int(mode)) for mode in np.flatnonzero(inside))


def _check_mode(measured: MeasuredFrfs, model: ModalModel, mode: int) -> SingleModeCheck:
    """Apply the single-mode methods to one mode."""
    pole = model.poles[mode] - measured.decay  # as it shows in the data
    natural, damping = float(abs(pole)) / (2 * np.pi), float(-pole.real / abs(pole))
    freq = measured.freq_hz
    lines = np.flatnonzero(np.abs(freq - natural) <= damping * natural)
    channels = np.zeros((0, 2), np.intp)
    reason = ""
    if damping <= 0:
        reason = "this mode grows, so that single-mode methods, which need damping, do not apply"
    elif len(lines) < _MIN_HALF_POWER_LINES:
        reason = (
            f"{len(lines)} frequency lines lie in the half-power band of "
            f"{2 * damping * natural:.3g} Hz, at least {_MIN_HALF_POWER_LINES} are needed: "
            "measure longer"
        )
    else:
        channels = _dominated_channels(measured, model, mode, lines)
        if not len(channels):
            reason = "this mode dominates no channel, so that single-mode methods cannot be applied"
    half_power = _half_power_dampings(measured, channels, lines)
    circles = _fit_circles(
        measured, channels, np.abs(freq - natural) <= _CIRCLE_HALF_WIDTH * damping * natural
    )
    values = measured.values[lines][:, channels[:, 0], channels[:, 1]]
    response = unit_response(freq[lines], natural, damping, measured.order)
    least_squares = least_squares_amplitude(values, response) if len(channels) else np.zeros(0)
    peak = peak_amplitude(_interpolate(freq[lines], values, natural), damping, measured.order)
    return SingleModeCheck(
        freq_hz=float(model.freq_hz[mode]),
        damping=float(model.damping[mode]),
        channels=channels,
        half_power_damping=_without_window(natural, _median(half_power), measured.decay)[1],
        half_power_channels=len(half_power),
        circle_freq_hz=_median_circle(circles, measured.decay)[0],
        circle_damping=_median_circle(circles, measured.decay)[1],
        circle_channels=len(circles),
        least_squares=least_squares,
        peak=peak,
        amplitude_difference=_median(relative_difference(least_squares, peak)[least_squares != 0]),
        reason=reason or _missing_reason(half_power, circles),
    )


def _dominated_channels(
    measured: MeasuredFrfs, model: ModalModel, mode: int, lines: Integers
) -> Integers:
    """Return the channels whose FRF one mode dominates in its half-power band, strongest first."""
    s = measured.laplace[lines]
    synthesis = modal_sum(model, s, measured.order)
    residue = np.outer(model.shapes[:, mode], model.participation[:, mode])
    pole, power = model.poles[mode], (s**measured.order)[:, None, None]
    direct, conjugate = (1 / (s - root)[:, None, None] for root in (pole, pole.conj()))
    modal_part = power * (residue * direct + residue.conj() * conjugate)
    size = np.abs(modal_part)
    rest = np.maximum(np.abs(synthesis - modal_part), np.abs(measured.values[lines] - modal_part))
    noise = np.sqrt(measured.variance[lines])
    is_dominated = measured.measured & (rest <= _MAX_OTHER_RESPONSE * size).all(axis=0)
    is_dominated &= (noise <= _MAX_RELATIVE_NOISE * size).all(axis=0) & (size > 0).all(axis=0)
    channels = np.argwhere(is_dominated)
    strength = size.max(axis=0)[channels[:, 0], channels[:, 1]]
    return channels[np.argsort(-strength, kind="stable")]


def _half_power_dampings(
    measured: MeasuredFrfs, channels: Integers, lines: Integers
) -> list[float]:
    """Return the half-power damping of each channel whose peak falls by 3 dB on both sides."""
    dampings = []
    for out, inp in channels:
        amplitude = np.abs(measured.values[:, out, inp])
        peak = int(lines[np.argmax(amplitude[lines])])
        try:
            dampings.append(half_power_damping(measured.freq_hz, amplitude, peak)[0])
        except InputError:  # the peak of this channel does not fall by 3 dB on both sides
            continue
    return dampings


def _fit_circles(measured: MeasuredFrfs, channels: Integers, nearby: np.ndarray) -> list[Circle]:
    """Fit circles to the mobility of the strongest channels."""
    circles = []
    mobility = (
        measured.values[nearby] * (measured.laplace[nearby] ** (1 - measured.order))[:, None, None]
    )
    for out, inp in channels[:_MAX_CIRCLES]:
        try:
            circles.append(circle_fit(measured.freq_hz[nearby], mobility[:, out, inp], 1))
        except InputError:  # the values of this channel do not form a circle
            continue
    return circles


def _median_circle(circles: list[Circle], decay: float) -> tuple[float | None, float | None]:
    """Return medians of natural frequency [Hz] and damping, without the exponential window."""
    natural = _median([circle.natural_hz for circle in circles])
    damping = _median([circle.damping for circle in circles])
    return (None, None) if natural is None else _without_window(natural, damping, decay)


def _without_window(
    natural: float, damping: float | None, decay: float
) -> tuple[float | None, float | None]:
    """Remove the exponential window from frequency and damping: ``s = s_seen + 1 / tau``."""
    if damping is None:
        return None, None
    omega = 2 * np.pi * natural
    pole = omega * complex(-damping, np.sqrt(max(1 - damping**2, 0.0))) + decay
    return abs(pole) / (2 * np.pi), -pole.real / abs(pole)


def _interpolate(freq: Real, values: Complex, natural: float) -> Complex:
    """Interpolate values at a frequency between two lines; (n_channel,)."""
    return np.array([np.interp(natural, freq, column) for column in values.T], complex)


def _median(values: "list[float] | Real") -> float | None:
    """Return the median, or None of nothing."""
    return float(np.median(values)) if len(values) else None


def _missing_reason(dampings: list[float], circles: list[Circle]) -> str:
    """Say which single-mode result is missing, and why."""
    if not dampings:
        return "no channel falls by 3 dB on both sides of the peak: no half-power damping"
    return "" if circles else "no channel goes round a circle: no circle fit"
