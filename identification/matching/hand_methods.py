r"""Damping and amplitude of impacts by hand, as tables 2 and 3 of the gondola's paper print them.

At a channel where a mode peaks, zeta is the width of the peak (eq. 16), and C comes from the lines
of that width by least squares (eq. 18) and from the peak alone, C = 2 zeta Im y(i w_r). What is
seen of the accelerance C H(s), eq. 11, begins when the force is over: it lacks C times the force's
own spectrum, so y = C (H - 1), whose imaginary part at resonance is C / (2 zeta) as before. The
moment of the force is known to some milliseconds, which turns a mode's values at all channels by
one phase: they are turned back until they lie along the imaginary axis at resonance.
"""

from dataclasses import dataclass

import numpy as np

from identification.impacts import ImpactSpectra
from identification.matching.measured_modes import ImpactModes
from identification.modal import (
    half_power_damping,
    least_squares_amplitude,
    peak_amplitude,
    unit_response,
)
from identification.words import Dof, InputError

_LEAST_LINES = 3


@dataclass(frozen=True)
class ByHand:
    """One channel's row of tables 2 and 3.

    Args:
        dof: of the channel.
        impact: number of the impact.
        lower, upper: where the peak has fallen by 3 dB [Hz].
        peak: its line [Hz].
        damping: zeta, eq. 16.
        least_squares: C by eq. 18 [m/s2 s].
        maximum: C by the peak, likewise.
    """

    dof: Dof
    impact: int
    lower: float
    upper: float
    peak: float
    damping: float
    least_squares: float
    maximum: float


def by_hand(
    spectra: ImpactSpectra, modes: ImpactModes, mode: int, count: int = 3
) -> tuple[ByHand, ...]:
    """Tables 2 and 3 for a mode: the channels that move most, in the impact that it shows in most.

    Channels whose peak does not fall by 3 dB on both sides, for another mode stands beside it, or
    whose peak is narrower than three lines, have no row.

    Args:
        spectra: of all impacts.
        modes: identified in them.
        mode: number of one.
        count: channels at most.
    """
    freq, impact = spectra.freq_hz, int(np.argmax(modes.excited[mode]))
    natural, damping = float(modes.frequencies[mode]), float(modes.dampings[mode])
    values = spectra.values[:, :, impact]
    turn = np.sqrt((values[np.argmin(np.abs(freq - natural))] ** 2).sum())
    values = 1j * values * np.conj(turn) / max(abs(turn), 1e-300)
    reach = max(damping * natural, 2 * float(freq[1] - freq[0]))
    near = np.flatnonzero(np.abs(freq - natural) <= reach)
    rows = []
    for channel in np.argsort(-np.abs(modes.shapes[mode]), kind="stable"):
        amplitude = np.abs(values[:, channel])
        peak = int(near[np.argmax(amplitude[near])])
        try:
            zeta, lower, upper = half_power_damping(freq, amplitude, peak)
        except InputError:  # not alone: this channel says nothing
            continue
        lines = (freq >= lower) & (freq <= upper)
        if lines.sum() < _LEAST_LINES:
            continue
        seen = unit_response(freq[lines], float(freq[peak]), zeta) - 1
        rows.append(
            ByHand(
                spectra.dofs[channel],
                impact,
                lower,
                upper,
                float(freq[peak]),
                zeta,
                float(least_squares_amplitude(values[lines, channel], seen)),
                float(peak_amplitude(values[peak, channel], zeta)),
            )
        )
        if len(rows) == count:
            break
    return tuple(rows)
