"""Damping and amplitude of impacts by single-mode methods, as in the gondola's paper.

Tables 2 and 3 of the paper hold them. At a channel where a mode peaks, zeta follows from the
half-power bandwidth (eq. 16). C follows from the lines of that band by least squares (eq. 18) and
from the peak alone, C = 2 zeta Im y(i w_r). The measured part of the accelerance C H(s), eq. 11,
begins when the force has ended. It lacks C times the spectrum of the force, so y = C (H - 1), whose
imaginary part at resonance is C / (2 zeta) too. The time of the force is known to some
milliseconds, which rotates the values of a mode at all channels by one phase. They are rotated back
until they lie along the imaginary axis at resonance.
"""

from dataclasses import dataclass

import numpy as np

from identification.impacts import ImpactSpectra
from identification.matching.measured_modes import (
    ImpactModes,
    nearest_mode,
    rotate_to_imaginary,
    strongest_impact,
)
from identification.modal import (
    half_power_damping,
    least_squares_amplitude,
    peak_amplitude,
    unit_response,
)
from identification.words import InputError

_MIN_PEAK_LINES = 3  # lines between the half-power points, for a least-squares amplitude
_MIN_IMAGINARY_SHARE = 0.5  # of the value at the peak: within 60 degrees of the axis
_MIN_SHAPE_SHARE = 0.05  # motion over that of the largest channel, below which noise peaks too


@dataclass(frozen=True)
class HandEstimate:
    """One channel's row of tables 2 and 3.

    Args:
        channel: label of the channel, such as ``acc1:+tx``.
        impact: file of the impact.
        lower, peak, upper: frequency line of the peak, and where it has fallen by 3 dB [Hz].
        damping: zeta, eq. 16.
        least_squares: C by eq. 18 [m/s2 s].
        maximum: C by the peak [m/s2 s].
    """

    channel: str
    impact: str
    lower: float
    peak: float
    upper: float
    damping: float
    least_squares: float
    maximum: float


def estimate_by_hand(
    spectra: ImpactSpectra, modes: ImpactModes, mode: int, max_rows: int = 3
) -> tuple[HandEstimate, ...]:
    """Compute tables 2 and 3 for a mode, at the channels that move most.

    The impact is the one that excites the mode most. A channel has no row if its peak does not fall
    by 3 dB on both sides, because of another mode beside it, if the peak is narrower than three
    lines, if it is nearer to another mode or far from the imaginary axis, or if the channel hardly
    moves.

    Args:
        max_rows: number of channels, at most.
    """
    freq = spectra.freq_hz
    natural, damping = float(modes.frequencies[mode]), float(modes.dampings[mode])
    values = rotate_to_imaginary(spectra, modes, mode)
    reach = max(damping * natural, 2 * float(freq[1] - freq[0]))
    nearby = np.flatnonzero(np.abs(freq - natural) <= reach)
    rows = []
    motion = np.abs(modes.shapes[mode])
    moving = np.flatnonzero(motion >= _MIN_SHAPE_SHARE * motion.max())
    for channel in moving[np.argsort(-motion[moving], kind="stable")]:
        amplitude = np.abs(values[:, channel])
        peak = int(nearby[np.argmax(amplitude[nearby])])
        is_turned = abs(values[peak, channel].imag) < _MIN_IMAGINARY_SHARE * amplitude[peak]
        if is_turned or nearest_mode(modes, float(freq[peak])) != mode:
            continue
        try:
            zeta, lower, upper = half_power_damping(freq, amplitude, peak)
        except InputError:  # another mode is close in this channel
            continue
        lines = (freq >= lower) & (freq <= upper)
        if lines.sum() < _MIN_PEAK_LINES:
            continue
        response = unit_response(freq[lines], float(freq[peak]), zeta) - 1
        rows.append(
            HandEstimate(
                str(spectra.dofs[channel]),
                spectra.sources[strongest_impact(modes, mode)],
                float(lower),
                float(freq[peak]),
                float(upper),
                float(zeta),
                float(least_squares_amplitude(values[lines, channel], response)),
                float(peak_amplitude(values[peak, channel], zeta)),
            )
        )
        if len(rows) == max_rows:
            break
    return tuple(rows)
