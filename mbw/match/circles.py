"""Circles of ``mbw match`` as rows of match.json, as arrays of match.npz and for its page."""

from typing import Any

import numpy as np

from identification.impacts import ImpactSpectra
from identification.matching import ChannelCircle, ModeCircles
from identification.words import Real
from mbw.match.schema import CircleRow, MatchFile, MatchRow
from mbw.page.html import pack_complex, pack_integers, pack_real


def circle_row(channel: ChannelCircle, impact: str) -> CircleRow:
    """Return the row of one mode and channel in match.json.

    Args:
        channel: the circle, or why there is none.
        impact: file of the impact.
    """
    circle = channel.circle
    return CircleRow(
        channel=str(channel.dof),
        impact=impact,
        frequency=None if circle is None else circle.natural_hz,
        damping=None if circle is None else circle.damping,
        amplitude=channel.amplitude,
        scatter=None if circle is None else circle.scatter,
        reason=channel.reason,
    )


def circle_arrays(circles: list[ModeCircles], spectra: ImpactSpectra) -> dict[str, Any]:
    """Return the lines and circles of all modes; NaN where a mode has no such line or circle.

    Returns:
        ``circle_freq_hz`` (n_mode, n_line), ``circle_values`` (n_mode, n_channel, n_line),
        ``circle_fitted`` (n_mode, n_line), and per mode and channel ``circle_centre``,
        ``circle_radius`` and ``circle_resonance``, the value at resonance on the circle [m/s].
    """
    count, channels = len(circles), len(spectra.dofs)
    lines = max((len(mode.freq_hz) for mode in circles), default=0)
    freq = np.full((count, lines), np.nan)
    values = np.full((count, channels, lines), np.nan + 0j)
    fitted = np.zeros((count, lines), bool)
    centre = np.full((count, channels), np.nan + 0j)
    radius = np.full((count, channels), np.nan)
    resonance = np.full((count, channels), np.nan + 0j)
    for number, mode in enumerate(circles):
        filled = slice(len(mode.freq_hz))
        freq[number, filled] = mode.freq_hz
        values[number, :, filled] = mode.values.T
        fitted[number, filled] = mode.is_fitted
        for k, channel in enumerate(mode.channels):
            if channel.circle is not None:
                centre[number, k] = channel.circle.centre
                radius[number, k] = channel.circle.radius
                turn = np.exp(1j * channel.circle.phase)
                resonance[number, k] = channel.circle.centre + channel.circle.radius * turn
    return {
        "circle_freq_hz": freq,
        "circle_values": values,
        "circle_fitted": fitted,
        "circle_centre": centre,
        "circle_radius": radius,
        "circle_resonance": resonance,
    }


def pack_circles(summary: MatchFile, arrays: dict[str, Any]) -> dict[str, object]:
    """Return what the page shows of the circles."""
    return {
        "freq": pack_real(arrays["circle_freq_hz"]),
        "values": pack_complex(arrays["circle_values"]),
        "fitted": pack_integers(arrays["circle_fitted"]),
        "centre": pack_complex(arrays["circle_centre"]),
        "radius": pack_real(arrays["circle_radius"]),
        "resonance": pack_complex(arrays["circle_resonance"]),
        "lines": int(arrays["circle_freq_hz"].shape[1]),
        "simulated": pack_real(_simulated_at_channels(summary, arrays)),
    }


def base_channel(row: MatchRow) -> int:
    """Return the number of the channel that moves most and has a circle; -1 without any."""
    motion = [
        -1.0 if circle.amplitude is None else abs(value)
        for value, circle in zip(row.shape, row.circles, strict=True)
    ]
    best = int(np.argmax(motion))
    return best if motion[best] >= 0 else -1


def _simulated_at_channels(summary: MatchFile, arrays: dict[str, Any]) -> Real:
    """Return the matching simulated shape of each measured mode; NaN without a match."""
    numbers = arrays["numbers"].tolist()
    shapes = np.full((len(summary.modes), len(summary.channels)), np.nan)
    for number, row in enumerate(summary.modes):
        if row.simulated is not None:
            shapes[number] = arrays["at"][numbers.index(row.simulated)]
    return shapes
