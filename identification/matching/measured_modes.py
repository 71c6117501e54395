"""Modes of impacts: poles from all channels and impacts at once, shapes weighted by excitation.

Phase of a mode in the spectra of impacts, whose force has an unknown time.

At resonance y(i w_r) = i C / (2 zeta) lies on the imaginary axis, at every channel (eq. 13 of the
gondola's paper). An unknown time of the force turns a mode at all channels by one phase. The phase
that makes the channels together most imaginary at resonance is taken off.
"""

from dataclasses import dataclass

import numpy as np

from identification.impacts import ImpactSpectra
from identification.modal import ModeCriteria, WeightedFrfs, identify_modes, mpc
from identification.words import Complex, ConvergenceError, Real

_MIN_EXCITATION_SD = 3.0  # excitation of a mode by an impact over its standard deviation, at least


@dataclass(frozen=True, eq=False)
class ImpactModes:
    """Measured modes.

    Args:
        frequencies: natural frequencies [Hz]; (n_mode,).
        dampings: damping ratios; (n_mode,).
        frequency_sd: standard deviations of the natural frequencies [Hz]; (n_mode,).
        damping_sd: standard deviations of the damping ratios; (n_mode,).
        shapes: real, of unit size; (n_mode, n_channel).
        variance: variance of their values; (n_mode, n_channel).
        excitation: excitation of each mode by each impact, in its standard deviations; (n_mode,
            n_impact).
        collinearity: MPC of the complex shapes; (n_mode,).
    """

    frequencies: Real
    dampings: Real
    frequency_sd: Real
    damping_sd: Real
    shapes: Real
    variance: Real
    excitation: Real
    collinearity: Real


def impact_modes(spectra: ImpactSpectra, criteria: ModeCriteria | None = None) -> ImpactModes:
    """Identify the modes of impacts.

    The spectrum of a free decay has the form of a receptance, sum A / (s - lambda) and its
    conjugate. A is the shape times the excitation of the mode by the impact: impacts are inputs of
    unknown size. An impact that does not excite a mode holds no information on it. For a single
    mode the residue of a channel has the variance 2 |Re lambda| d v, with d the spacing of
    frequency lines [Hz] and v their variance. Over impacts the values of the shape are averaged
    with weights by excitation.

    Raises:
        ConvergenceError: no mode in the band.
    """
    laplace = np.asarray(2j * np.pi * spectra.freq_hz, complex)
    weights = np.ones((len(laplace), 1, 1))
    data = WeightedFrfs(
        laplace, 0, spectra.values, weights, 1 / np.maximum(spectra.variance, 1e-300)
    )
    identified = identify_modes(data, spectra.freq_hz, criteria)
    fit = identified.fit
    inside = identified.inside
    spacing = float(spectra.freq_hz[1] - spectra.freq_hz[0])
    decay = np.abs(fit.poles.real)
    # |l|^2 / var(A) of each mode, channel and impact.
    residue = 2 * decay[:, None, None] * spacing * spectra.variance
    information = (np.abs(fit.participation.T[:, None, :]) ** 2 / residue).sum(axis=2)
    deviation = np.sqrt(residue.mean(axis=1))
    size = np.sqrt((np.abs(fit.shapes.T) ** 2).mean(axis=1))
    excitation = np.abs(fit.participation.T) * size[:, None] / deviation
    inside = inside & (excitation.max(axis=1) > _MIN_EXCITATION_SD)
    if not inside.any():
        raise ConvergenceError(
            f"no mode between {spectra.freq_hz[0]:g} and {spectra.freq_hz[-1]:g} Hz exceeds the "
            "noise. Hit harder, or at another place."
        )
    real = np.array([rotate_to_real(shape) for shape in fit.shapes.T])
    unit = np.linalg.norm(real, axis=1)[:, None]
    poles = fit.poles[inside]
    return ImpactModes(
        np.abs(poles) / (2 * np.pi),
        -poles.real / np.abs(poles),
        identified.freq_sd[inside],
        identified.damping_sd[inside],
        (real / unit)[inside],
        (0.5 / np.maximum(information, 1e-300) / unit**2)[inside],  # the other half is out of phase
        excitation[inside],
        mpc(fit.shapes)[inside],
    )


def rotate_to_real(shape: Complex) -> Real:
    """Rotate a complex shape to its dominant phase and return the real part."""
    rotation = np.sqrt((shape**2).sum())
    size = abs(rotation)
    return np.asarray((shape * np.conj(rotation) / size).real if size > 0 else shape.real, float)


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
    return 1j * values * np.conj(rotation) / max(abs(rotation), 1e-300)
