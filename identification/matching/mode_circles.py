r"""Circles of the measured modes in the Nyquist plane, at every channel (figs. 6 and 7).

The figures are those of the gondola's paper. An impact leaves a free decay, whose spectrum near a
mode is y = A / (i w - lambda) + B, with B the other modes and the conjugate: an exact circle
through B, of the diameter |A| / (zeta w_r) = C / (2 zeta) (eq. 13). The angle around the centre
sweeps as for a mobility, but for a part zeta^2. Damping and natural frequency follow from all lines
beside the peak and not from three of them, as by the half-power width. The half-power points lie a
quarter turn from the resonance on either side, at 9 and 3 o'clock in fig. 6.

C is signed: channels that move against each other have opposite signs. The ratio of two channels is
the ratio of the simulated shape there, with its sign (eq. 19). The paper compares ratios without
signs and names signed ratios by circles as its first improvement.
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
from identification.modal import Circle, circle_fit
from identification.words import Complex, Dof, InputError, Mask, Real

# Half-width of the fitted lines over zeta f_r: 1.5 half-power bandwidths in all.
_FITTED_HALF_WIDTH = 1.5
# Half-width of the lines that a plot shows, over zeta f_r: the circle is seen to close.
_PLOT_HALF_WIDTH = 3.0
_MAX_PLOT_LINES = 121  # lines of a plot: more points than a circle of some centimetres shows
_MAX_SCATTER = 0.25  # rms distance of the lines over the radius: beyond, they show no circle
_MOBILITY = 1  # the spectrum of a decay goes round a circle as a mobility does


@dataclass(frozen=True)
class ChannelCircle:
    """Circle of one mode at one channel.

    Args:
        dof: degree of freedom of the channel.
        circle: fitted circle [m/s]; None if there is none.
        amplitude: C, signed [m/s]; None without a circle.
        reason: why there is no circle; empty if there is one.
    """

    dof: Dof
    circle: Circle | None
    amplitude: float | None
    reason: str


@dataclass(frozen=True, eq=False)
class ModeCircles:
    """Circles of one mode at all channels, in the impact that excites it most.

    Args:
        impact: number of the impact.
        freq_hz: lines around the mode, for a plot [Hz]; (n_line,).
        values: y there, imaginary at resonance [m/s]; (n_line, n_channel).
        is_fitted: lines within the band of the fit; (n_line,).
        channels: circle of each channel.
    """

    impact: int
    freq_hz: Real
    values: Complex
    is_fitted: Mask
    channels: tuple[ChannelCircle, ...]


def fit_mode_circles(spectra: ImpactSpectra, modes: ImpactModes, mode: int) -> ModeCircles:
    """Fit a circle to one mode at every channel.

    Args:
        spectra: spectra of all impacts, on lines close enough to show a circle.
    """
    values = rotate_to_imaginary(spectra, modes, mode)
    freq, natural = spectra.freq_hz, float(modes.frequencies[mode])
    distance = np.abs(freq - natural) / (float(modes.dampings[mode]) * natural)
    fitted = distance <= _FITTED_HALF_WIDTH
    near = np.flatnonzero(distance <= _PLOT_HALF_WIDTH)
    shown = near[:: max(1, -(-len(near) // _MAX_PLOT_LINES))]
    channels = tuple(
        _refuse_other_mode(_fit_channel(dof, freq[fitted], values[fitted, k]), modes, mode)
        for k, dof in enumerate(spectra.dofs)
    )
    impact = strongest_impact(modes, mode)
    return ModeCircles(impact, freq[shown], values[shown], fitted[shown], channels)


def _refuse_other_mode(channel: ChannelCircle, modes: ImpactModes, mode: int) -> ChannelCircle:
    """Return a channel without its circle if the circle is that of another measured mode."""
    if channel.circle is None:
        return channel
    nearest = nearest_mode(modes, channel.circle.natural_hz)
    if nearest == mode:
        return channel
    reason = (
        f"the circle has its resonance at {channel.circle.natural_hz:.4g} Hz: here the mode at "
        f"{modes.frequencies[nearest]:.4g} Hz dominates"
    )
    return ChannelCircle(channel.dof, None, None, reason)


def _fit_channel(dof: Dof, freq_hz: Real, values: Complex) -> ChannelCircle:
    """Fit a circle to the lines of one channel, or say why there is none."""
    try:
        circle = circle_fit(freq_hz, values, _MOBILITY)
    except InputError as error:
        return ChannelCircle(dof, None, None, str(error))
    if not freq_hz[0] <= circle.natural_hz <= freq_hz[-1]:
        reason = (
            f"the circle in {freq_hz[0]:.4g}..{freq_hz[-1]:.4g} Hz has its resonance outside, at "
            f"{circle.natural_hz:.4g} Hz: another mode dominates there"
        )
        return ChannelCircle(dof, None, None, reason)
    if circle.scatter > _MAX_SCATTER:
        reason = f"the lines scatter by {100 * circle.scatter:.0f} % of the radius around a circle"
        return ChannelCircle(dof, None, None, reason)
    # |C| = 2 zeta times the diameter; the sign is the side of the real axis at resonance.
    size = 4 * circle.damping * circle.radius
    return ChannelCircle(dof, circle, float(np.copysign(size, circle.phase)), "")
