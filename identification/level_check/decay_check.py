r"""Level check of one free decay: all modes that ring long and alone, against their amplitude.

Frequency and damping of a mode against its amplitude, from one free decay.

A mode that rings alone is z(t) = a(t) exp(i phi(t)) behind a narrow filter. Its local frequency and
damping ratio are

    f = phi' / (2 pi),    zeta = -(ln a)' / sqrt(phi'^2 + (ln a)'^2),

as in the analysis of free vibration by the analytic signal (Feldman 1994). Both slopes are fitted
by straight lines over spans of time in which the amplitude falls by the same factor. So one hit
shows the mode at every level that it passes.
"""

from dataclasses import dataclass

import numpy as np
import scipy.fft
from scipy.ndimage import median_filter

from identification.level_check.trends import NO_CHANGE, ModeTrend, find_clearest_trend
from identification.words import Complex, Real

_SPAN_NATS = 0.2  # fall of the amplitude over one span, as its logarithm
_MIN_SPAN_PERIODS = 12  # periods that a span lasts at least
_MAX_SPANS = 16  # spans of one decay
_FILTER_ENDS = 1.5  # time at either end that the filter spoils, over one over its bandwidth
_FLOOR_RATIO = 8.0  # amplitude over that of noise, where the mode has ended, from which it counts
_MAX_GROWTH_DEVIATION = 0.1  # of the slope of the amplitude, from which a decay is followed no more
_CURVE_DEGREE = 3  # of the curve of frequency and damping over the logarithm of the amplitude


@dataclass(frozen=True, eq=False)
class DecayTrack:
    """A mode along one free decay.

    Args:
        trend: frequency and damping at rising amplitudes.
        shape: amplitude and phase of each channel over those of the largest; (n_channel,).
    """

    trend: ModeTrend
    shape: Complex


def track_decay(
    motion: Real, rate_hz: float, freq_hz: float, bandwidth_hz: float
) -> DecayTrack | None:
    """Follow one mode along a free decay; None where it rings too shortly.

    Args:
        motion: signals from the first instant without force; (n_channel, n_sample).
        rate_hz: samples per second.
        freq_hz: about the frequency of the mode.
        bandwidth_hz: of the filter about it, to either side; no other mode may lie within.
    """
    analytic = _filter(motion, rate_hz, freq_hz, bandwidth_hz)
    ends = int(_FILTER_ENDS / bandwidth_hz * rate_hz)
    analytic = analytic[:, ends : analytic.shape[1] - ends]
    if analytic.shape[1] < 2 * _MIN_SPAN_PERIODS * rate_hz / freq_hz:
        return None
    vectors, _, _ = np.linalg.svd(analytic @ analytic.conj().T)
    shape = vectors[:, 0] / vectors[np.abs(vectors[:, 0]).argmax(), 0]
    path = shape.conj() @ analytic / (np.abs(shape) ** 2).sum()
    spans = _find_spans(path, rate_hz, freq_hz)
    if len(spans) < 2:
        return None
    fits = np.array([_fit_span(path[first:last], rate_hz, bandwidth_hz) for first, last in spans])
    is_vague = fits[:, 3] > _MAX_GROWTH_DEVIATION * np.abs(fits[:, 2])
    fits = fits[: int(is_vague.argmax()) if is_vague.any() else len(fits)][::-1]
    if len(fits) < 2:
        return None
    turn, turn_sd, growth, growth_sd, amplitude = fits.T
    size = np.hypot(2 * np.pi * freq_hz + turn, growth)
    frequency, damping = size / (2 * np.pi), -growth / size
    trend = ModeTrend(
        amplitude,
        frequency,
        _widen_by_scatter(amplitude, frequency, turn_sd / (2 * np.pi)),
        damping,
        _widen_by_scatter(amplitude, damping, growth_sd / size),
    )
    return DecayTrack(trend, shape)


def _widen_by_scatter(amplitude: Real, values: Real, deviations: Real) -> Real:
    """Return deviations that cover the scatter about a smooth curve over the amplitude.

    Other modes that the filter passes beat with this one, and noise is not white behind it.
    """
    degree = min(_CURVE_DEGREE, len(values) - 2)
    if degree < 1:
        return deviations
    curve = np.polynomial.Polynomial.fit(np.log(amplitude), values, degree, w=1 / deviations)
    off = (values - curve(np.log(amplitude))) / deviations
    scatter = float((off**2).sum()) / (len(values) - degree - 1)
    return deviations * np.sqrt(max(1.0, scatter))


def _filter(motion: Real, rate_hz: float, freq_hz: float, bandwidth_hz: float) -> Complex:
    """Return analytic signals turned back by the frequency, behind a Gaussian filter."""
    count = motion.shape[1]
    size = scipy.fft.next_fast_len(2 * count)
    lines = scipy.fft.fftfreq(size, 1 / rate_hz)
    window = 2 * np.exp(-2 * ((lines - freq_hz) / bandwidth_hz) ** 2)
    analytic = scipy.fft.ifft(scipy.fft.fft(motion, size) * window)[:, :count]
    times = np.arange(count) / rate_hz
    return analytic * np.exp(-2j * np.pi * freq_hz * times)


def _find_spans(path: Complex, rate_hz: float, freq_hz: float) -> list[tuple[int, int]]:
    """Return first and last sample of spans in which the amplitude falls by the same factor."""
    size = np.log(np.abs(path))
    begin, tenth = int(size.argmax()), max(len(size) // 10, 1)
    floor, before = size[-tenth:].mean(), size[-2 * tenth : -tenth].mean()
    has_ended = before - floor < _SPAN_NATS / 2
    lowest = floor + np.log(_FLOOR_RATIO) if has_ended else size[-1]
    step = max(_SPAN_NATS, (size[begin] - lowest) / _MAX_SPANS)
    shortest = int(_MIN_SPAN_PERIODS * rate_hz / freq_hz)
    spans, first = [], begin
    while True:
        below = np.flatnonzero(size[first:] < max(size[first] - step, lowest))
        last = first + max(int(below[0]) if len(below) else len(size), shortest)
        if not len(below) or last >= len(size):
            break
        spans.append((first, last))
        if size[last] <= lowest + step / 2:
            break
        first = last
    return spans


def _fit_span(path: Complex, rate_hz: float, bandwidth_hz: float) -> tuple[float, ...]:
    """Return slopes of phase and logarithm of the amplitude, each with its deviation, and size.

    The filter leaves some two independent values for each period of its bandwidth.
    """
    times = np.arange(len(path)) / rate_hz
    centred = times - times.mean()
    independent = max(2 * bandwidth_hz * times[-1], 3.0)
    slopes: list[float] = []
    for values in (np.unwrap(np.angle(path)), np.log(np.abs(path))):
        slope = float(centred @ values / (centred @ centred))
        off = values - values.mean() - slope * centred
        scatter = float((off**2).mean()) * independent / (independent - 2)
        slopes += [slope, float(np.sqrt(scatter / independent / (centred**2).mean()))]
    return (*slopes, float(np.exp(np.log(np.abs(path)).mean())))


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
    from scipy.signal import find_peaks  # noqa: PLC0415  # slow to load

    peaks, _ = find_peaks(above, height=np.log(_MIN_PEAK_RATIO), distance=5)
    freq = peaks[peaks >= first] * spacing
    gaps = np.diff(freq, prepend=-np.inf, append=np.inf)
    nearest = np.minimum(gaps[:-1], gaps[1:])
    width = np.minimum(_NEIGHBOUR_SHARE * nearest, _MAX_BANDWIDTH_SHARE * freq)
    return [(float(f), float(b)) for f, b in zip(freq, width, strict=True) if b > 4 * spacing]
