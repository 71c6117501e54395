"""Level check of one free decay: all modes that ring long and alone, against their amplitude."""

from dataclasses import dataclass

import numpy as np
import scipy.fft
from scipy.ndimage import median_filter
from scipy.signal import find_peaks

from identification.level_check.free_decay import DecayTrack, track_decay
from identification.level_check.trends import NO_CHANGE, find_clearest_trend
from identification.words import Real

_MIN_PEAK_RATIO = 8.0  # spectrum over its running median, from which a peak is a mode that rings
_MEDIAN_SHARE = 0.25  # of the frequency: half the width of that median
_MAX_BANDWIDTH_SHARE = 0.3  # filter to either side over the frequency
_NEIGHBOUR_SHARE = 0.45  # filter to either side over the distance to the next peak
_MIN_PERIODS = 60  # of a mode within the record


@dataclass(frozen=True, eq=False)
class DecayCheck:
    """Modes along one free decay.

    Args:
        tracks: of each mode that could be followed, by its frequency.
    """

    tracks: tuple[DecayTrack, ...]

    @property
    def sentence(self) -> str:
        """Finding in one or two sentences."""
        if not self.tracks:
            return "Level check of the decay: no mode rings long enough, alone."
        trend = find_clearest_trend([track.trend for track in self.tracks])
        if trend is None:
            return f"Level check of the decay: {NO_CHANGE}."
        return (
            f"Level check of the decay: modes depend on the amplitude. {trend.sentence} These "
            f"are the values at amplitudes of {trend.level[0]:.3g} and {trend.level[-1]:.3g}."
        )


def check_decay(motion: Real, rate_hz: float) -> DecayCheck:
    """Follow all modes of a free decay that ring long and alone.

    Args:
        motion: signals from the first instant without force; (n_channel, n_sample), or (n_sample,)
            of a single channel.
        rate_hz: samples per second.
    """
    motion = np.atleast_2d(motion)
    tracks = [
        track
        for freq, bandwidth in _find_ringing_modes(motion, rate_hz)
        if (track := track_decay(motion, rate_hz, freq, bandwidth)) is not None
    ]
    tracks.sort(key=lambda track: float(track.trend.freq_hz[0]))
    return DecayCheck(tuple(tracks))


def _find_ringing_modes(motion: Real, rate_hz: float) -> list[tuple[float, float]]:
    """Return frequency and half the filter's width of each sharp peak of the spectrum [Hz]."""
    window = np.hanning(2 * motion.shape[1])[motion.shape[1] :]
    spectrum = np.sqrt((np.abs(scipy.fft.rfft(motion * window)) ** 2).sum(axis=0))
    spacing = rate_hz / motion.shape[1]
    first = int(_MIN_PERIODS)  # so many periods in the record
    log = np.log(np.maximum(spectrum, spectrum.max() * 1e-12))
    grid = np.geomspace(first, len(log) - 1, 4000)
    steps = 4000 * np.log1p(_MEDIAN_SHARE) / np.log((len(log) - 1) / first)
    level = median_filter(np.interp(grid, np.arange(len(log)), log), 2 * int(steps) + 1)
    above = log - np.interp(np.arange(len(log)), grid, level)
    peaks, _ = find_peaks(above, height=np.log(_MIN_PEAK_RATIO), distance=5)
    freq = peaks[peaks >= first] * spacing
    gaps = np.diff(freq, prepend=-np.inf, append=np.inf)
    nearest = np.minimum(gaps[:-1], gaps[1:])
    width = np.minimum(_NEIGHBOUR_SHARE * nearest, _MAX_BANDWIDTH_SHARE * freq)
    return [(float(f), float(b)) for f, b in zip(freq, width, strict=True) if b > 4 * spacing]
