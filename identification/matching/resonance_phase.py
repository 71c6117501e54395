"""Phase of a mode in the spectra of impacts, whose force has an unknown time.

At resonance y(i w_r) = i C / (2 zeta) lies on the imaginary axis, at every channel (eq. 13 of the
gondola's paper). An unknown time of the force turns a mode at all channels by one phase. The phase
that makes the channels together most imaginary at resonance is taken off.
"""

import numpy as np

from identification.impacts import ImpactSpectra
from identification.matching.measured_modes import ImpactModes
from identification.words import Complex


def strongest_impact(modes: ImpactModes, mode: int) -> int:
    """Return the number of the impact that excites a mode most."""
    return int(np.argmax(modes.excitation[mode]))


def nearest_mode(modes: ImpactModes, freq_hz: float) -> int:
    """Return the number of the measured mode whose frequency is nearest to one [Hz]."""
    return int(np.argmin(np.abs(modes.frequencies - freq_hz)))


def rotate_to_imaginary(spectra: ImpactSpectra, modes: ImpactModes, mode: int) -> Complex:
    """Return the spectra of the strongest impact, imaginary at the resonance of a mode.

    The sign that all channels share stays unknown.

    Returns:
        (n_freq, n_channel) [m/s].
    """
    values = spectra.values[:, :, strongest_impact(modes, mode)]
    line = np.argmin(np.abs(spectra.freq_hz - modes.frequencies[mode]))
    rotation = np.sqrt((values[line] ** 2).sum())
    rotated: Complex = 1j * values * np.conj(rotation) / max(abs(rotation), 1e-300)
    return rotated
