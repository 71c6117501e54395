"""Modes of impacts: poles of all channels and impacts at once, shapes weighted by both."""

from dataclasses import dataclass

import numpy as np

from identification.impacts import ImpactSpectra
from identification.modal import Data, Tolerances, identify_modes, mpc
from identification.words import Complex, ConvergenceError, Real

_EXCITED = 3.0  # deviations: an impact that a mode shows in


@dataclass(frozen=True, eq=False)
class ImpactModes:
    """Measured modes.

    Args:
        frequencies: natural [Hz]; (n_mode,).
        dampings: ratios; (n_mode,).
        frequency_sd: (n_mode,) [Hz].
        damping_sd: (n_mode,).
        shapes: real, of unit size; (n_mode, n_channel).
        variance: of their values; (n_mode, n_channel).
        excited: how far each impact excites each mode, in deviations of it; (n_mode, n_impact).
        collinearity: MPC of the complex shapes; (n_mode,).
    """

    frequencies: Real
    dampings: Real
    frequency_sd: Real
    damping_sd: Real
    shapes: Real
    variance: Real
    excited: Real
    collinearity: Real


def impact_modes(spectra: ImpactSpectra, tolerances: Tolerances | None = None) -> ImpactModes:
    r"""Identify the modes of impacts.

    The spectrum of a free decay is that of a receptance's kind, sum A / (s - lambda) and its twin,
    A = shape times how far the impact excites the mode: impacts are inputs of unknown size, and one
    that does not excite a mode tells nothing of it. Of a single mode the residue of a channel has
    the variance 2 |Re lambda| d v, d the spacing of lines [Hz] and v their variance; over impacts
    the shape's values are averaged with weights of what excites it.

    Args:
        spectra: of all impacts.
        tolerances: when poles count as one mode.

    Raises:
        ConvergenceError: no mode in the band.
    """
    laplace = np.asarray(2j * np.pi * spectra.freq_hz, complex)
    weights = np.ones((len(laplace), 1, 1))
    data = Data(laplace, 0, spectra.values, weights, 1 / np.maximum(spectra.variance, 1e-300))
    found = identify_modes(data, spectra.freq_hz, tolerances)
    fit = found.fit
    inside = found.inside
    spacing = float(spectra.freq_hz[1] - spectra.freq_hz[0])
    decay = np.abs(fit.poles.real)
    # |l|^2 / var(A) of each mode, channel and impact.
    residue = 2 * decay[:, None, None] * spacing * spectra.variance
    told = (np.abs(fit.participation.T[:, None, :]) ** 2 / residue).sum(axis=2)
    deviation = np.sqrt(residue.mean(axis=1))
    size = np.sqrt((np.abs(fit.shapes.T) ** 2).mean(axis=1))
    excited = np.abs(fit.participation.T) * size[:, None] / deviation
    inside = inside & (excited.max(axis=1) > _EXCITED)
    if not inside.any():
        raise ConvergenceError(
            f"no mode between {spectra.freq_hz[0]:g} and {spectra.freq_hz[-1]:g} Hz stands out of "
            "the noise. Hit harder, or elsewhere."
        )
    real = np.array([in_phase(shape) for shape in fit.shapes.T])
    unit = np.linalg.norm(real, axis=1)[:, None]
    poles = fit.poles[inside]
    return ImpactModes(
        np.abs(poles) / (2 * np.pi),
        -poles.real / np.abs(poles),
        found.freq_sd[inside],
        found.damping_sd[inside],
        (real / unit)[inside],
        (0.5 / np.maximum(told, 1e-300) / unit**2)[inside],  # the other half is out of phase
        excited[inside],
        mpc(fit.shapes)[inside],
    )


def in_phase(shape: Complex) -> Real:
    """A complex shape as real: its phase taken off, as far as it has one."""
    turn = np.sqrt((shape**2).sum())
    size = abs(turn)
    return np.asarray((shape * np.conj(turn) / size).real if size > 0 else shape.real, float)
