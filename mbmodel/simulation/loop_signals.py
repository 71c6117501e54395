"""Signals of closed loops in time: which drive the machine, when they come, what is recorded."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from identification.words import Loop, Mask, Real, UsageError, sampling_period
from mbmodel.simulation.drives import Drive, LoopSignal, find_drives
from mbmodel.simulation.time_model import TimeModel

_MIN_STEPS, _MAX_ALIGNED_STEPS = 4, 40  # per sample of the signals
PERIOD_ROUNDING = 1e-6  # of a period, in sampling rates and delays
_STILL_SHARE = 1e-9  # of the range of a reference, between instants: it rests
_SETTLED_SHARE_OF_MOVE = 0.02  # of the distance of the last move, as for a step of the reference


@dataclass(frozen=True, eq=False)
class LoopRecord:
    """Signals of a closed loop in time.

    Args:
        loop: the loop.
        time_s: instants [s]; (n_time,).
        reference: r, in the unit of what it measures; (n_time,).
        measured: y without noise and rounding, a position from the first one of r; (n_time,).
        control: input of the machine within its limit; (n_time,).
    """

    loop: Loop
    time_s: Real
    reference: Real
    measured: Real
    control: Real

    @property
    def error(self) -> Real:
        """Tracking error r - y; (n_time,)."""
        return self.reference - self.measured

    @property
    def limited_share(self) -> float:
        """Share of the time at the limit."""
        limit = self.loop.limit
        return 0.0 if limit is None else float(np.mean(np.abs(self.control) >= limit))

    def since(self, first: int, time_s: Real) -> "LoopRecord":
        """Return the record from an instant on, with other times [s]; (n_time - first,)."""
        parts = (values[first:] for values in (self.reference, self.measured, self.control))
        return LoopRecord(self.loop, time_s, *parts)

    def settling_time_s(self, window: float | None = None) -> float | None:
        """Return the time from the end of the last move until the error stays in a window [s].

        Args:
            window: largest magnitude of the error; None for 2 % of the reference's last change.

        Returns:
            None if the reference never moves, or the error does not settle.
        """
        least = _STILL_SHARE * float(np.ptp(self.reference))  # below it a spline rounds
        moving = np.flatnonzero(np.abs(np.diff(self.reference)) > least)
        if not len(moving):
            return None
        last = int(moving[-1]) + 1
        still = np.flatnonzero(np.diff(moving) > 1)
        start = int(moving[still[-1] + 1]) if len(still) else int(moving[0])
        change = abs(self.reference[last] - self.reference[start])
        bound = _SETTLED_SHARE_OF_MOVE * change if window is None else window
        outside = np.flatnonzero(np.abs(self.error[last:]) > bound)
        if not len(outside):
            return 0.0
        end = last + int(outside[-1]) + 1
        return None if end == len(self.time_s) else float(self.time_s[end] - self.time_s[last])


class LoopDrives(NamedTuple):
    """How loops drive the machine.

    Args:
        gain: entries of the control vector per unit of each loop's input; (n_control, n_loop).
        reference, noise, command: 1 where an input of the simulation is that of a loop;
            (n_in, n_loop).
    """

    gain: Real
    reference: Real
    noise: Real
    command: Real


def drive_loops(model: TimeModel, loops: Sequence[Loop], inputs: Sequence[Drive]) -> LoopDrives:
    """Return how loops drive a machine, and which inputs act through them.

    Args:
        inputs: of the simulation.
    """
    names = [loop.name for loop in loops]
    signals = {kind: np.zeros((len(inputs), len(loops))) for kind in LoopDrives._fields[1:]}
    for row, drive in enumerate(inputs):
        if isinstance(drive, LoopSignal):
            signals[drive.kind][row, names.index(drive.loop)] = 1.0
    return LoopDrives(find_drives(model, [loop.input for loop in loops]).gain, **signals)


def reference_remarks(loops: Sequence[Loop], begins: Real) -> tuple[str, ...]:
    """Return a sentence on each reference that does not begin at 0.

    Args:
        begins: first value of each reference; (n_loop,).
    """
    sentences = []
    for loop, begin, rests in zip(loops, begins.tolist(), mask_position_loops(loops), strict=True):
        where = "where the machine rests" if rests else "but the machine rests"
        how = "begin at 0 for a step" if rests else "the loop begins with a step"
        if begin:
            sentences.append(f"{LoopSignal(loop.name)} begins at {begin:.4g}, {where}: {how}")
    return tuple(sentences)


def mask_position_loops(loops: Sequence[Loop]) -> Mask:
    """Return which loops read a position, whose origin is where the machine rests; (n_loop,)."""
    measured = [loop.measured for loop in loops]
    return np.array([each.unit in ("m", "rad") and not each.derivative for each in measured], bool)


def samples_per_period(loops: Sequence[Loop], rate_hz: float) -> int:
    """Return how many samples of the signals a sampling period of loops has; 1 if continuous.

    Args:
        loops: that are closed, all of one sampling period.
        rate_hz: of the signals [Hz].

    Raises:
        UsageError: the samples do not divide the period.
    """
    period = sampling_period(loops)
    count = round(period * rate_hz) if period else 1
    if period and (not count or abs(count / (period * rate_hz) - 1) > PERIOD_ROUNDING):
        raise UsageError(
            f"the loops are sampled every {period:g} s, which samples at {rate_hz:g} Hz do not "
            f"divide: give a whole multiple of {1 / period:g} Hz as the rate"
        )
    return count


def steps_per_sample(loops: Sequence[Loop], rate_hz: float) -> int:
    """Return the fewest steps per sample of the signals at which delayed controls arrive.

    Args:
        loops: that are closed.
        rate_hz: of the signals [Hz].

    Returns:
        From 4 to 40; 4 where no number of steps meets all delays, which then end within a step.
    """
    delays = np.array([loop.delay for loop in loops if loop.controller.period_s]) * rate_hz
    for steps in range(_MIN_STEPS, _MAX_ALIGNED_STEPS + 1):
        if (np.abs(delays * steps - np.round(delays * steps)) < PERIOD_ROUNDING).all():
            return steps
    return _MIN_STEPS
