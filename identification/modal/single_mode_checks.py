"""Identified modes beside what the hand methods say of them, where a mode is alone enough."""

from dataclasses import dataclass

import numpy as np

from identification.modal.campaign_modes import Measured
from identification.modal.circle_fit_method import Circle, circle_fit
from identification.modal.half_power_method import (
    difference,
    half_power_damping,
    least_squares_amplitude,
    peak_amplitude,
    unit_response,
)
from identification.words import Complex, InputError, Integers, ModalModel, Real, modal_sum

_ALONE = 0.3  # of a mode's part of an FRF, what all else may be at most
_QUIET = 0.05  # noise of a line, relative to it
_WIDE = 1.5  # half-power bandwidths from which a circle is taken, halved
_LEAST_LINES = 5  # in the half-power band
_MOST_CIRCLES = 12


@dataclass(frozen=True, eq=False)
class ClassicalMode:
    """One identified mode, and what the hand methods say of it; None where they say nothing.

    A channel is an (output, input) in which the mode makes all but a small part of the FRF over
    its half-power band. An exponential window still in the data is taken off.

    Args:
        freq_hz, damping: as identified [Hz, 1].
        channels: numbers of output and input; (n_channel, 2).
        half_power_damping: median of eq. 16 over the channels that fall by 3 dB on both sides.
        half_power_channels: how many do.
        circle_freq_hz, circle_damping: medians of the circles of the strongest channels [Hz, 1].
        circle_channels: how many could be fitted.
        least_squares: C of each channel by eq. 18, signed; (n_channel,).
        peak: C of each channel from the value at resonance, signed; (n_channel,).
        amplitude_difference: median of their relative difference, as in table 3.
        reason: why something is missing; empty if nothing is.
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


def classical_checks(measured: Measured, model: ModalModel) -> tuple[ClassicalMode, ...]:
    """Half-power damping, circle fit and both amplitudes for every mode inside the band.

    Args:
        measured: FRFs that the modes were found from.
        model: the modes, with those beside the band if there are any.

    Returns:
        One entry a mode inside the band, in the order of the model.
    """
    lowest, highest = measured.freq_hz[[0, -1]]
    inside = (model.freq_hz >= lowest) & (model.freq_hz <= highest) & (model.damping > 0)
    return tuple(_check(measured, model, int(mode)) for mode in np.flatnonzero(inside))


def _check(measured: Measured, model: ModalModel, mode: int) -> ClassicalMode:
    pole = model.poles[mode] - measured.decay  # as it shows in the data
    natural, damping = float(abs(pole)) / (2 * np.pi), float(-pole.real / abs(pole))
    freq = measured.freq_hz
    lines = np.flatnonzero(np.abs(freq - natural) <= damping * natural)
    channels = np.zeros((0, 2), np.intp)
    reason = ""
    if len(lines) < _LEAST_LINES:
        reason = (
            f"{len(lines)} lines in the half-power band of {2 * damping * natural:.3g} Hz, at "
            f"least {_LEAST_LINES} are needed: measure longer"
        )
    else:
        channels = _alone(measured, model, mode, lines)
        if not len(channels):
            reason = "no channel in which this mode stands alone: not to be resolved by hand"
    widths = _half_power(measured, channels, lines)
    circles = _circles(measured, channels, np.abs(freq - natural) <= _WIDE * damping * natural)
    values = measured.values[lines][:, channels[:, 0], channels[:, 1]]
    response = unit_response(freq[lines], natural, damping, measured.order)
    one = least_squares_amplitude(values, response) if len(channels) else np.zeros(0)
    other = peak_amplitude(_at(freq[lines], values, natural), damping, measured.order)
    return ClassicalMode(
        freq_hz=float(model.freq_hz[mode]),
        damping=float(model.damping[mode]),
        channels=channels,
        half_power_damping=_corrected(natural, _median(widths), measured.decay)[1],
        half_power_channels=len(widths),
        circle_freq_hz=_circle(circles, measured.decay)[0],
        circle_damping=_circle(circles, measured.decay)[1],
        circle_channels=len(circles),
        least_squares=one,
        peak=other,
        amplitude_difference=_median(difference(one, other)[one != 0]),
        reason=reason or _missing(widths, circles),
    )


def _alone(measured: Measured, model: ModalModel, mode: int, lines: Integers) -> Integers:
    """Channels in which one mode makes the FRF all over its half-power band, strongest first."""
    s = measured.laplace[lines]
    whole = modal_sum(model, s, measured.order)
    residue = np.outer(model.shapes[:, mode], model.participation[:, mode])
    pole, power = model.poles[mode], (s**measured.order)[:, None, None]
    away, twin = (1 / (s - root)[:, None, None] for root in (pole, pole.conj()))
    own = power * (residue * away + residue.conj() * twin)
    size = np.abs(own)
    others = np.maximum(np.abs(whole - own), np.abs(measured.values[lines] - own))
    noise = np.sqrt(measured.variance[lines])
    alone = measured.measured & (others <= _ALONE * size).all(axis=0)
    alone &= (noise <= _QUIET * size).all(axis=0) & (size > 0).all(axis=0)
    found = np.argwhere(alone)
    strength = size.max(axis=0)[found[:, 0], found[:, 1]]
    return found[np.argsort(-strength, kind="stable")]


def _half_power(measured: Measured, channels: Integers, lines: Integers) -> list[float]:
    found = []
    for out, inp in channels:
        amplitude = np.abs(measured.values[:, out, inp])
        peak = int(lines[np.argmax(amplitude[lines])])
        try:
            found.append(half_power_damping(measured.freq_hz, amplitude, peak)[0])
        except InputError:  # no 3 dB on one side: this channel says nothing
            continue
    return found


def _circles(measured: Measured, channels: Integers, near: np.ndarray) -> list[Circle]:
    found = []
    mobility = (
        measured.values[near] * (measured.laplace[near] ** (1 - measured.order))[:, None, None]
    )
    for out, inp in channels[:_MOST_CIRCLES]:
        try:
            found.append(circle_fit(measured.freq_hz[near], mobility[:, out, inp], 1))
        except InputError:  # no circle: this channel says nothing
            continue
    return found


def _circle(circles: list[Circle], decay: float) -> tuple[float | None, float | None]:
    natural = _median([circle.natural_hz for circle in circles])
    damping = _median([circle.damping for circle in circles])
    return (None, None) if natural is None else _corrected(natural, damping, decay)


def _corrected(
    natural: float, damping: float | None, decay: float
) -> tuple[float | None, float | None]:
    """Natural frequency and damping without the exponential window: s = s_seen + 1 / tau."""
    if damping is None:
        return None, None
    omega = 2 * np.pi * natural
    pole = omega * complex(-damping, np.sqrt(max(1 - damping**2, 0.0))) + decay
    return abs(pole) / (2 * np.pi), -pole.real / abs(pole)


def _at(freq: Real, values: Complex, natural: float) -> Complex:
    """Values at a frequency between two lines; (n_channel,)."""
    found: Complex = np.array([np.interp(natural, freq, column) for column in values.T], complex)
    return found


def _median(values: "list[float] | Real") -> float | None:
    return float(np.median(values)) if len(values) else None


def _missing(widths: list[float], circles: list[Circle]) -> str:
    if not widths:
        return "no channel falls by 3 dB on both sides of the peak: no damping by its width"
    return "" if circles else "no channel goes round a circle"
