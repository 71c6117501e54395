"""Hits in a record of force: where they begin, how long the hammer touches, whether it bounces.

A sample belongs to a pulse where the force without its median is above 3 % of the largest and above
8 times the noise, whose standard deviation is 1.4826 times the median of the absolute deviation (a
normal distribution; the few samples of the pulses do not move a median). From its peak a pulse
reaches as far as the force is above 1 % of that peak and 3 times the noise (hysteresis).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from identification.words import Real, Records

_SHARE, _NOISES = 0.03, 8.0  # of the largest force, of the noise: what is a pulse
_FOOT, _FOOT_NOISES = 0.01, 3.0  # of its own peak, of the noise: how far it reaches
_MAD = 1.4826
_TALL = 0.25  # of the median of all pulses, weighted by their height
_BOUNCE = 0.1  # of the time between deliberate hits: sooner, a pulse belongs to the one before
_FASTEST = 0.5  # s: hits by hand are further apart
_RINGS = 4  # widths of a pulse beside it, in which hammer and filters may ring
_RING = 0.25  # of the pulse
_LOBE = 0.4  # of a lobe, that the one of the other sign beside it has


@dataclass(frozen=True)
class Pulse:
    """One contact of the hammer.

    Args:
        record: from 0.
        onset: first sample.
        end: sample after the last.
        height: largest force, signed [N].
    """

    record: int
    onset: int
    end: int
    height: float

    @property
    def width(self) -> int:
        """Samples from first to last, at least two."""
        return max(self.end - self.onset, 2)


@dataclass(frozen=True)
class Blow:
    """A pulse with what came too soon after or before it to be another hit.

    Args:
        main: its largest pulse.
        bounces: the others, without the ringing of hammer and filters.
        number: from 1, through all records by time.
        until: samples from the first rise to the next blow, or to the record's end.
        is_last: whether the record ends there.
    """

    main: Pulse
    bounces: tuple[Pulse, ...]
    number: int
    until: int
    is_last: bool

    @property
    def onset(self) -> int:
        """First sample of the first pulse."""
        return min(pulse.onset for pulse in (self.main, *self.bounces))

    @property
    def end(self) -> int:
        """Sample after the last of the last pulse."""
        return max(pulse.end for pulse in (self.main, *self.bounces))


def find_blows(records: Records) -> tuple[Blow, ...]:
    """Find the hits of all records, by record and time."""
    pulses = [_pulses(number, force) for number, force in enumerate(records.force)]
    gap = _bounce_time(pulses, records.force.shape[1], records.rate_hz)
    blows: list[Blow] = []
    for own in pulses:
        groups: list[list[Pulse]] = []
        for pulse in own:
            if groups and pulse.onset - groups[-1][-1].onset < gap:
                groups[-1].append(pulse)
            else:
                groups.append([pulse])
        for place, group in enumerate(groups):
            last = place == len(groups) - 1
            stop = records.force.shape[1] if last else groups[place + 1][0].onset
            blows.append(_blow(group, len(blows) + 1, stop, last))
    return tuple(blows)


def _blow(group: list[Pulse], number: int, stop: int, is_last: bool) -> Blow:
    main = max(group, key=lambda pulse: abs(pulse.height))
    bounces = tuple(
        pulse for pulse in group if pulse is not main and not _rings(pulse, main, group)
    )
    first = min([main, *bounces], key=lambda pulse: pulse.onset)
    return Blow(main, bounces, number, stop - first.onset, is_last)


def _rings(pulse: Pulse, main: Pulse, group: Sequence[Pulse]) -> bool:
    """Whether a pulse is a lobe of what rings about zero beside the main one, not a bounce.

    Close to it, below a quarter of it, and of the other sign or beside a lobe of the other sign.
    """
    reach = _RINGS * main.width
    near = main.onset - reach <= pulse.onset <= main.end + reach
    if not near or abs(pulse.height) >= _RING * abs(main.height):
        return False
    beside = 2 * pulse.width
    lobes = [p.height for p in group if p is not main and abs(p.onset - pulse.onset) <= beside]
    swing = max(-np.sign(main.height) * height for height in lobes)
    return pulse.height * main.height < 0 or swing >= _LOBE * abs(pulse.height)


def quiet_force(force: Real) -> tuple[Real, float]:
    """Force without its median, and the standard deviation of its noise; any shape (n_sample,)."""
    level = force - np.median(force)
    return level, float(_MAD * np.median(np.abs(level)))


def _pulses(record: int, force: Real) -> list[Pulse]:
    level, noise = quiet_force(force)
    size = np.abs(level)
    above = size > max(_NOISES * noise, _SHARE * size.max())
    sides = np.concatenate([[0], np.where(above, np.sign(level), 0.0), [0]])
    turns = np.flatnonzero(np.diff(sides))
    found: list[Pulse] = []
    for start, stop in pairwise(turns):
        if sides[start + 1] == 0 or (found and start < found[-1].end):
            continue  # between pulses, or the same one, above the threshold once more
        peak = start + int(np.argmax(size[start:stop]))
        foot = max(_FOOT_NOISES * noise, _FOOT * size[peak])
        outside = np.flatnonzero(np.sign(level[peak]) * level <= foot)
        at = int(np.searchsorted(outside, peak))
        onset = int(outside[at - 1]) + 1 if at else 0
        end = int(outside[at]) if at < len(outside) else len(level)
        tallest = onset + int(np.argmax(size[onset:end]))
        found.append(Pulse(record, onset, end, float(level[tallest])))
    return found


def _bounce_time(pulses: Sequence[list[Pulse]], samples: int, rate_hz: float) -> float:
    """Samples within which a pulse belongs to the one before.

    A tenth of the median time between hits. Times that are at once below half a second and below
    a tenth of the mean time a pulse has are no times between deliberate hits.
    """
    heights = np.sort([abs(pulse.height) for own in pulses for pulse in own])
    if not heights.size:
        return 0.0
    # Half of the sum of all heights: neither the many lobes of ringing nor one bang decide.
    total = heights.cumsum()
    tall = _TALL * heights[np.searchsorted(total, total[-1] / 2)]
    onsets = [np.array([p.onset for p in own if abs(p.height) >= tall]) for own in pulses]
    share = samples * len(pulses) / sum(len(own) for own in onsets)
    shortest = min(_BOUNCE * share, _FASTEST * rate_hz)
    times = np.concatenate([np.diff(own) for own in onsets])
    times = times[times >= shortest]
    typical = float(np.median(times)) if times.size else share
    return _BOUNCE * typical
