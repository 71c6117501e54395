"""Detection of hits in records of force: onset, contact time, and bounces (double hits).

A pulse is where the force without its median exceeds 3 % of the largest force and 8 standard
deviations of its noise. The standard deviation is 1.4826 times the median absolute deviation, which
the few samples of the pulses do not change. From its peak a pulse extends as far as the force
exceeds 1 % of that peak and 3 standard deviations of the noise (hysteresis). Pulses that follow
each other too fast to be deliberate hits form one hit, with bounces.

Kind of excitation: hits of a hammer, or the force of a shaker or motor that never rests.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from identification.words import InputError, Real, Records

# A pulse exceeds this share of the largest force and these standard deviations of the noise.
_MIN_PULSE_SHARE, _MIN_PULSE_DEVIATIONS = 0.03, 8.0
# It extends down to this share of its own peak and these standard deviations of the noise.
_PULSE_FOOT_SHARE, _PULSE_FOOT_DEVIATIONS = 0.01, 3.0
_NORMAL_MAD_FACTOR = 1.4826  # standard deviation over median absolute deviation
_MIN_HIT_HEIGHT = 0.25  # of the height-weighted median of all pulses: deliberate hits are higher
_MAX_BOUNCE_TIME = 0.1  # of the time between deliberate hits: later pulses are hits
_MIN_HIT_INTERVAL_S = 0.5  # s: hits by hand are further apart
_RINGING_WIDTHS = 4  # pulse widths beside a pulse in which hammer and filters may ring
_MAX_RINGING_HEIGHT = 0.25  # of the pulse
_MIN_LOBE_HEIGHT = 0.4  # of a lobe of ringing, that its neighbour of opposite sign has


@dataclass(frozen=True)
class Pulse:
    """Pulse of force: one contact of the hammer.

    Args:
        record: index of the record, from 0.
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
        """Number of samples, at least two."""
        return max(self.end - self.onset, 2)


@dataclass(frozen=True)
class Blow:
    """Detected hit: its largest pulse, and pulses too close to it to be another hit.

    Args:
        main: largest pulse.
        bounces: other pulses, without the ringing of hammer and filters.
        number: number of the hit through all records by time, from 1.
        span: samples from the first rise to the next hit, or to the end of the record.
        is_last: whether this is the last hit of its record.
    """

    main: Pulse
    bounces: tuple[Pulse, ...]
    number: int
    span: int
    is_last: bool

    @property
    def onset(self) -> int:
        """First sample of the first pulse."""
        return min(pulse.onset for pulse in (self.main, *self.bounces))

    @property
    def end(self) -> int:
        """Sample after the end of the last pulse."""
        return max(pulse.end for pulse in (self.main, *self.bounces))


def find_blows(records: Records) -> tuple[Blow, ...]:
    """Find the hits of all records, in the order of record and time."""
    pulses = [_find_pulses(number, force) for number, force in enumerate(records.force)]
    max_bounce = _bounce_time(pulses, records.force.shape[1], records.rate_hz)
    blows: list[Blow] = []
    for of_record in pulses:
        groups: list[list[Pulse]] = []
        for pulse in of_record:
            if groups and pulse.onset - groups[-1][-1].onset < max_bounce:
                groups[-1].append(pulse)
            else:
                groups.append([pulse])
        for position, group in enumerate(groups):
            is_last = position == len(groups) - 1
            stop = records.force.shape[1] if is_last else groups[position + 1][0].onset
            blows.append(_blow(group, len(blows) + 1, stop, is_last))
    return tuple(blows)


def _blow(group: list[Pulse], number: int, stop: int, is_last: bool) -> Blow:
    """Build a hit from pulses that belong together; ``stop`` is the sample where its span ends."""
    main = max(group, key=lambda pulse: abs(pulse.height))
    bounces = tuple(
        pulse for pulse in group if pulse is not main and not _is_ringing(pulse, main, group)
    )
    first = min([main, *bounces], key=lambda pulse: pulse.onset)
    return Blow(main, bounces, number, stop - first.onset, is_last)


def _is_ringing(pulse: Pulse, main: Pulse, group: Sequence[Pulse]) -> bool:
    """Return whether a pulse is a lobe of ringing about zero beside the main pulse, not a bounce.

    A lobe is close to the main pulse and below a quarter of it. It has the opposite sign, or a
    neighbour with the opposite sign.
    """
    reach = _RINGING_WIDTHS * main.width
    is_near = main.onset - reach <= pulse.onset <= main.end + reach
    if not is_near or abs(pulse.height) >= _MAX_RINGING_HEIGHT * abs(main.height):
        return False
    distance = 2 * pulse.width
    lobes = [p.height for p in group if p is not main and abs(p.onset - pulse.onset) <= distance]
    opposite = max(-np.sign(main.height) * height for height in lobes)
    return pulse.height * main.height < 0 or opposite >= _MIN_LOBE_HEIGHT * abs(pulse.height)


def quiet_force(force: Real) -> tuple[Real, float]:
    """Return the force without its median, and the standard deviation of its noise.

    Args:
        force: force [N]; (n_sample,).

    Returns:
        Force without its offset [N] (n_sample,), and the standard deviation [N].
    """
    level = force - np.median(force)
    return level, float(_NORMAL_MAD_FACTOR * np.median(np.abs(level)))


def _find_pulses(record: int, force: Real) -> list[Pulse]:
    """Find the pulses of one record, by time."""
    level, noise = quiet_force(force)
    size = np.abs(level)
    is_above = size > max(_MIN_PULSE_DEVIATIONS * noise, _MIN_PULSE_SHARE * size.max())
    signs = np.concatenate([[0], np.where(is_above, np.sign(level), 0.0), [0]])
    crossings = np.flatnonzero(np.diff(signs))
    pulses: list[Pulse] = []
    for start, stop in pairwise(crossings):
        if signs[start + 1] == 0 or (pulses and start < pulses[-1].end):
            continue  # between pulses, or inside the last pulse
        peak = start + int(np.argmax(size[start:stop]))
        foot = max(_PULSE_FOOT_DEVIATIONS * noise, _PULSE_FOOT_SHARE * size[peak])
        outside = np.flatnonzero(np.sign(level[peak]) * level <= foot)
        after = int(np.searchsorted(outside, peak))
        onset = int(outside[after - 1]) + 1 if after else 0
        end = int(outside[after]) if after < len(outside) else len(level)
        tallest = onset + int(np.argmax(size[onset:end]))
        pulses.append(Pulse(record, onset, end, float(level[tallest])))
    return pulses


def _bounce_time(pulses: Sequence[list[Pulse]], n_sample: int, rate_hz: float) -> float:
    """Return the samples within which a pulse belongs to the previous one.

    It is a tenth of the median time between deliberate hits. Times below half a second are not
    counted if they are also below a tenth of the record time for each pulse.
    """
    heights = np.sort([abs(pulse.height) for of_record in pulses for pulse in of_record])
    if not heights.size:
        return 0.0
    # The median weighted by height depends neither on many lobes of ringing nor on one hard hit.
    total = heights.cumsum()
    min_height = _MIN_HIT_HEIGHT * heights[np.searchsorted(total, total[-1] / 2)]
    onsets = [
        np.array([p.onset for p in of_record if abs(p.height) >= min_height])
        for of_record in pulses
    ]
    mean_interval = n_sample * len(pulses) / sum(len(of_record) for of_record in onsets)
    shortest = min(_MAX_BOUNCE_TIME * mean_interval, _MIN_HIT_INTERVAL_S * rate_hz)
    intervals = np.concatenate([np.diff(of_record) for of_record in onsets])
    intervals = intervals[intervals >= shortest]
    typical = float(np.median(intervals)) if intervals.size else mean_interval
    return _MAX_BOUNCE_TIME * typical


# Net over absolute impulse of all pulses: a hammer pushes and never pulls, so that its hits have 1.
# With lobes of 60 % of their predecessor, the worst ringing of a hammer that is read, they have
# (1 - 0.6) / (1 + 0.6) = 0.25. N lobes of random sign have sqrt(2 / (pi N)): 0.15 for 30 of them.
_MIN_NET_IMPULSE = 0.2


def is_continuous(records: Records, blows: Sequence[Blow]) -> bool:
    """Return whether a force is no series of hits: it never rests, or pulls as much as it pushes.

    Args:
        blows: hits that were found in them.

    Raises:
        InputError: the force is zero.
    """
    if not np.ptp(records.force, axis=1).any():
        raise InputError(
            f"{records.test}: there is no hit in the force along {records.reference}: check which "
            "channel is the force"
        )
    return not blows or _net_impulse(records, blows) < _MIN_NET_IMPULSE


def refuse_exchanged_force(records: Records) -> None:
    """Refuse records in which a motion is a series of hits and the force is not.

    Args:
        records: of a force that never rests.

    Raises:
        InputError: a motion looks like the force of a hammer.
    """
    for row, output in enumerate(records.outputs):
        motion = records.motion[:, row]
        exchanged = replace(records, force=motion)
        if np.ptp(motion, axis=1).any() and not is_continuous(exchanged, find_blows(exchanged)):
            raise InputError(
                f"{records.test}: the force along {records.reference} never rests, but {output} is "
                "a series of hits: check which channel is the force"
            )


def _net_impulse(records: Records, blows: Sequence[Blow]) -> float:
    """Return the net impulse of all pulses of each record over their absolute impulse."""
    net, total = np.zeros(len(records.force)), 0.0
    levels = records.force - np.median(records.force, axis=1, keepdims=True)
    for blow in blows:
        for pulse in (blow.main, *blow.bounces):
            impulse = float(levels[pulse.record, pulse.onset : pulse.end].sum())
            net[pulse.record] += impulse
            total += abs(impulse)
    return float(np.abs(net).sum() / total) if total else 1.0
