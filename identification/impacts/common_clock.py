"""Common clock of channels that keep their own time, and the onset of the impact on it.

Each channel is a band-limited signal y(t) known at its stamps t_i. A spline of fifth order through
them has an error of about (2 pi f d)^6 / 1000 for a tone f at spacings d. At 1260 samples a second
this is 1e-4 at 100 Hz, whatever the jitter. The spline is evaluated on an even grid of the mean
rate.

The impact begins where the channels together rise out of their noise. The energy e(t) is what a
quarter of the channels exceed of (y / rms before)^2, smoothed over some milliseconds, since a spike
of one channel is no impact. The onset is where it first reaches a set share of its largest value.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.ndimage import uniform_filter1d

from identification.impacts.records import ImpactRecord
from identification.words import Dof, InputError, Mask, Real

_SPLINE_ORDER = 5  # order of the interpolating spline, so that its error is negligible
# Pause over the median spacing beyond which a channel cannot be interpolated.
_MAX_GAP_SPACINGS = 8.0
_SMOOTHING_S = 4e-3  # window of the energy [s], so that the spike of one channel is no impact
_MAD_TO_NOISE_SD = 1.4826  # standard deviation over median absolute deviation, normal distribution
_ONSET_CHANNEL_SHARE = 0.25  # share of the channels whose energy rises at an impact, at least
_ONSET_LEVEL = 0.02  # energy over its largest value at which the impact begins
_MIN_IMPACT_ENERGY = 25.0  # energy over that before the impact, at least
_QUIET_SHARE = 0.02  # length of the quietest stretch, as a share of the record
_MAX_SILENT_RANGE = 1e-3  # range over that of the median channel below which one is silent
_VARIANCE_BLOCK = 64  # samples of a block whose variance is compared with that of the noise
# Largest variance after the impact over that before it, below which a channel may be deaf.
_MAX_DEAF_RISE = 2.0
# Median over channels of that ratio, above which every channel must respond to the impact.
_MIN_AUDIBLE_RISE = 400.0


@dataclass(frozen=True, eq=False)
class SynchronisedImpact:
    """One impact whose channels share a clock.

    Args:
        source: file of the record.
        dofs: degrees of freedom of the channels, along their positive directions; n_channel.
        rate_hz: sampling rate of the grid [Hz].
        before: samples before the impact, except the last ones; (n_channel, n_before) [m/s2].
        after: samples from the impact on; (n_channel, n_after) [m/s2].
        start: time of the impact on the record's clock [s].
    """

    source: str
    dofs: tuple[Dof, ...]
    rate_hz: float
    before: Real
    after: Real
    start: float


def synchronise(record: ImpactRecord) -> SynchronisedImpact:
    """Resample the channels of an impact on one clock and find its onset.

    Raises:
        InputError: channels that share no time, a pause, no impact, or a silent channel.
    """
    start = max(float(channel.time[0]) for channel in record.channels)
    end = min(float(channel.time[-1]) for channel in record.channels)
    spacing = [float(np.median(np.diff(channel.time))) for channel in record.channels]
    rate = 1 / float(np.median(spacing))
    if end - start < _SMOOTHING_S:
        raise InputError(
            f"{record.source}: its channels have no time in common ({start:.6g} s is the last "
            f"start, {end:.6g} s the first end). Check that their stamps are of one clock."
        )
    grid = np.arange(start, end, 1 / rate)
    rows = []
    for channel, channel_spacing in zip(record.channels, spacing, strict=True):
        _check_gaps(record.source, str(channel.dof), channel.time, channel_spacing, (start, end))
        sign = -1.0 if channel.dof != channel.dof.positive else 1.0
        rows.append(sign * make_interp_spline(channel.time, channel.value, k=_SPLINE_ORDER)(grid))
    values = np.array(rows)
    dofs = tuple(channel.dof.positive for channel in record.channels)
    first = _find_onset(record.source, values, rate)
    # The force may begin a little before the response is detected.
    before, after = values[:, : max(first - 3 * round(_SMOOTHING_S * rate), 0)], values[:, first:]
    _check_silent(record.source, dofs, before, after)
    return SynchronisedImpact(record.source, dofs, rate, before, after, float(grid[first]))


def _check_gaps(
    source: str, name: str, time: Real, spacing: float, common: tuple[float, float]
) -> None:
    """Refuse a channel with a pause in the time that all channels share."""
    gaps = np.flatnonzero(np.diff(time) > _MAX_GAP_SPACINGS * spacing)
    for k in gaps.tolist():
        if time[k + 1] > common[0] and time[k] < common[1]:
            raise InputError(
                f"{source}: {name} pauses from {time[k]:.6g} to {time[k + 1]:.6g} s. Cut the "
                "record there, or leave the channel out."
            )


def _find_onset(source: str, values: Real, rate: float) -> int:
    """Return the number of the first sample of the impact."""
    width = max(1, round(_SMOOTHING_S * rate))
    centred = values - np.median(values, axis=1, keepdims=True)
    # The onset is not known yet: the quietest stretch of each channel stands for its noise.
    quiet_samples = max(width, int(_QUIET_SHARE * values.shape[1]))
    power = uniform_filter1d(centred**2, quiet_samples, axis=1, mode="nearest").min(axis=1)
    has_noise = power > 0
    if not has_noise.any():
        raise InputError(f"{source}: all channels are silent. Check cables and ranges.")
    channel_energy = uniform_filter1d(
        centred[has_noise] ** 2 / power[has_noise, None], width, mode="nearest"
    )
    energy = np.quantile(channel_energy, 1 - _ONSET_CHANNEL_SHARE, axis=0, method="lower")
    if energy.max() < _MIN_IMPACT_ENERGY:
        raise InputError(
            f"{source} holds no impact: its channels never rise "
            f"{np.sqrt(_MIN_IMPACT_ENERGY):.0f} times above their quietest stretch."
        )
    level = max(_ONSET_LEVEL * float(energy.max()), float(np.sqrt(energy.max())))
    first = int(np.argmax(energy > level)) + width // 2
    return min(first, int(values.shape[1]) - 2)


def _check_silent(source: str, dofs: tuple[Dof, ...], before: Real, after: Real) -> None:
    """Refuse a channel that reads nothing, or whose noise continues as if there were no impact."""
    ranges = np.ptp(after, axis=1)
    silent = np.flatnonzero(
        (ranges <= _MAX_SILENT_RANGE * np.median(ranges)) | _find_deaf_channels(before, after)
    )
    if len(silent):
        names = ", ".join(str(dofs[k]) for k in silent)
        raise InputError(
            f"{source}: {names} {'is' if len(silent) == 1 else 'are'} silent after the impact. "
            "Check the cable, or leave the channel out with ignore."
        )


def _find_deaf_channels(before: Real, after: Real) -> Mask:
    """Return channels whose noise does not change where most others rise far above theirs."""
    count = after.shape[1] // _VARIANCE_BLOCK
    if before.shape[1] < _VARIANCE_BLOCK or not count:
        return np.zeros(len(after), bool)
    blocks = after[:, : count * _VARIANCE_BLOCK].reshape(len(after), count, _VARIANCE_BLOCK)
    level = np.median(before, axis=1, keepdims=True)  # the median ignores spikes
    noise = (_MAD_TO_NOISE_SD * np.median(np.abs(before - level), axis=1)) ** 2
    rise = blocks.var(axis=2).max(axis=1) / np.maximum(noise, 1e-300)
    return (rise < _MAX_DEAF_RISE) & (np.median(rise) > _MIN_AUDIBLE_RISE)
