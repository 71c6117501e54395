r"""One clock for channels that keep their own, and the moment of the impact on it.

Each channel is a band-limited signal y(t) known at its stamps t_i. A spline of fifth order through
them has an error of (2 pi f d)^6 / 1000 or so of a tone f at spacings d: at 1260 samples a second
1e-4 at 100 Hz, whatever the jitter. It is read on an even grid of the mean rate.

The impact is where the channels together rise out of what they read before: e(t) what a quarter of
the channels exceed of (y / rms before)^2, smoothed over some milliseconds, since a spike of one
channel is no impact; where it first is a set part of its largest value.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.ndimage import uniform_filter1d

from identification.impacts.records import ImpactRecord
from identification.words import Dof, InputError, Mask, Real

_ORDER = 5
_GAP = 8.0  # times the median spacing: a channel that pauses for longer knows nothing there
_SMOOTH = 4e-3  # s
_NORMAL = 1.4826  # standard deviations in the median of absolute deviations
_HEAR = 0.25  # of the channels, that an impact rises in
_RISES = 0.02  # of the largest, where the impact begins
_LOUD = 25.0  # times what is read before: less is no impact
_BEFORE = 0.02  # of the record, its least quiet part
_SILENT = 1e-3  # of the median channel, of what it reads after the impact
_BLOCKS = 64  # samples, by whose variance a channel is heard
_NOISE = 2.0  # times the variance before, where a channel never reads more after
_HEARD = 400.0  # times that, what the others read: an impact that every channel must hear


@dataclass(frozen=True, eq=False)
class Struck:
    """One impact on a common clock.

    Args:
        source: the file.
        dofs: of the channels, along their positive directions; n_channel.
        rate_hz: of the grid.
        before: samples ahead of the impact, but the last ones; (n_channel, n_before) [m/s2].
        after: samples from the impact on; (n_channel, n_after) [m/s2].
        start: of the impact on the record's clock [s].
    """

    source: str
    dofs: tuple[Dof, ...]
    rate_hz: float
    before: Real
    after: Real
    start: float


def struck(record: ImpactRecord) -> Struck:
    """Put an impact's channels on one clock and find it.

    Raises:
        InputError: channels that share no time, a pause, no impact, a silent channel.
    """
    start = max(float(one.time[0]) for one in record.channels)
    end = min(float(one.time[-1]) for one in record.channels)
    spacing = [float(np.median(np.diff(one.time))) for one in record.channels]
    rate = 1 / float(np.median(spacing))
    if end - start < _SMOOTH:
        raise InputError(
            f"{record.source}: its channels have no time in common ({start:.6g} s is the last "
            f"start, {end:.6g} s the first end). Are their stamps of one clock?"
        )
    grid = np.arange(start, end, 1 / rate)
    rows = []
    for one, own in zip(record.channels, spacing, strict=True):
        _check_gaps(record.source, str(one.dof), one.time, own, (start, end))
        sign = -1.0 if one.dof != one.dof.positive else 1.0
        rows.append(sign * make_interp_spline(one.time, one.value, k=_ORDER)(grid))
    values = np.array(rows)
    dofs = tuple(one.dof.positive for one in record.channels)
    first = _onset(record.source, values, rate)
    # The force may begin a little before it is seen.
    before, after = values[:, : max(first - 3 * round(_SMOOTH * rate), 0)], values[:, first:]
    _check_silent(record.source, dofs, before, after)
    return Struck(record.source, dofs, rate, before, after, float(grid[first]))


def _check_gaps(
    source: str, name: str, time: Real, spacing: float, common: tuple[float, float]
) -> None:
    gaps = np.flatnonzero(np.diff(time) > _GAP * spacing)
    for k in gaps.tolist():
        if time[k + 1] > common[0] and time[k] < common[1]:
            raise InputError(
                f"{source}: {name} pauses from {time[k]:.6g} to {time[k + 1]:.6g} s. Cut the "
                "record there, or leave the channel out."
            )


def _onset(source: str, values: Real, rate: float) -> int:
    """Number of the first sample of the impact."""
    width = max(1, round(_SMOOTH * rate))
    centred = values - np.median(values, axis=1, keepdims=True)
    # What is read before is not known yet: of each channel the quietest stretch.
    quiet = max(width, int(_BEFORE * values.shape[1]))
    power = uniform_filter1d(centred**2, quiet, axis=1, mode="nearest").min(axis=1)
    heard = power > 0
    if not heard.any():
        raise InputError(f"{source}: all channels are silent. Check cables and ranges.")
    each = uniform_filter1d(centred[heard] ** 2 / power[heard, None], width, mode="nearest")
    energy = np.quantile(each, 1 - _HEAR, axis=0, method="lower")
    if energy.max() < _LOUD:
        raise InputError(
            f"{source} holds no impact: its channels never rise {np.sqrt(_LOUD):.0f} times above "
            "their quietest stretch."
        )
    level = max(_RISES * float(energy.max()), float(np.sqrt(energy.max())))
    first = int(np.argmax(energy > level)) + width // 2
    return min(first, int(values.shape[1]) - 2)


def _check_silent(source: str, dofs: tuple[Dof, ...], before: Real, after: Real) -> None:
    """A channel that is still, or whose noise goes on as if nothing had happened."""
    size = np.ptp(after, axis=1)
    dead = np.flatnonzero((size <= _SILENT * np.median(size)) | _deaf(before, after))
    if len(dead):
        names = ", ".join(str(dofs[k]) for k in dead)
        raise InputError(
            f"{source}: {names} {'is' if len(dead) == 1 else 'are'} silent after the impact. Check "
            "the cable, or leave the channel out with ignore."
        )


def _deaf(before: Real, after: Real) -> Mask:
    """Channels whose noise does not change where most of the others rise far out of theirs."""
    count = after.shape[1] // _BLOCKS
    if before.shape[1] < _BLOCKS or not count:
        return np.zeros(len(after), bool)
    parts = after[:, : count * _BLOCKS].reshape(len(after), count, _BLOCKS)
    level = np.median(before, axis=1, keepdims=True)  # a spike is no noise
    noise = (_NORMAL * np.median(np.abs(before - level), axis=1)) ** 2
    rise = parts.var(axis=2).max(axis=1) / np.maximum(noise, 1e-300)
    deaf: Mask = (rise < _NOISE) & (np.median(rise) > _HEARD)
    return deaf
