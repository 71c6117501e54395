r"""Periodic signals of stated amplitudes: phases with a low peak, and orthogonal realisations.

*Phases*: those of Schroeder (1970) give line k the phase

    phi_k = -2 pi sum_{j <= k} (k - j) p_j,    p_j the share of the power at line j.

The signal is then a sweep that stays at each frequency in proportion to its power. Swapping between
time and frequency lowers the peak further (van der Ouderaa, Schoukens and Renneboog 1988): the
waveform is clipped, its phases are kept, and its amplitudes are set back.

*Realisations*: q drives that act at once need q different signals each, or no FRF can be told from
another. Realisation r of drive d is turned by exp(2 pi i r d / q). The signals of any two drives
are then orthogonal at each line over all realisations (Dobrowiecki, Schoukens and Guillaume 2006).
"""

import numpy as np
import scipy.fft

from identification.words import Complex, Integers, Real

_SWAPS = 200
_CLIPS = (0.75, 0.98)  # of the peak, from the first swap to the last


def schroeder_phases(power: Real) -> Real:
    """Return the phases of a sweep with this power at its lines [rad]; (n_line,)."""
    share = power / power.sum()
    phases: Real = -2 * np.pi * np.cumsum(np.cumsum(share) - share)
    return phases


def lower_peak(amplitudes: Complex, lines: Integers, samples: int, phases: Real) -> Real:
    """Return phases at which a waveform has a low peak [rad]; (n_line,).

    Args:
        amplitudes: of the waveform per exp(i phase) of the signal; (n_line,).
        lines: their numbers, 1 for one period in the record; (n_line,).
        samples: of the record.
        phases: of the signal at the start; (n_line,).
    """
    best, lowest = phases, np.inf
    for clip in np.linspace(*_CLIPS, _SWAPS):
        waveform = periodic_waveform(amplitudes * np.exp(1j * phases), lines, samples)
        peak = float(np.abs(waveform).max())
        if peak < lowest:
            best, lowest = phases, peak
        clipped = np.clip(waveform, -clip * peak, clip * peak)
        phases = np.angle(scipy.fft.rfft(clipped)[lines] / amplitudes)
    return best


def periodic_waveform(amplitudes: Complex, lines: Integers, samples: int) -> Real:
    """Return sum_k Re a_k exp(2 pi i k t) over one period; (..., n_sample).

    Args:
        amplitudes: a; (..., n_line).
        lines: k; (n_line,).
        samples: of the period.
    """
    spectrum = np.zeros((*amplitudes.shape[:-1], samples // 2 + 1), np.complex128)
    spectrum[..., lines] = amplitudes * (samples / 2)
    waveform: Real = scipy.fft.irfft(spectrum, samples, axis=-1)
    return waveform


def orthogonal_turns(drives: int) -> Complex:
    """Return the factor of each realisation and drive, a unitary matrix times sqrt q; (q, q)."""
    numbers = np.arange(drives)
    turns = np.exp(2j * np.pi * np.outer(numbers, numbers) / drives)
    return np.asarray(turns, np.complex128)
