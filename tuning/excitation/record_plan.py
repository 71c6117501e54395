"""Periods, realisations and lines of a periodic excitation within a given time."""

from dataclasses import dataclass

import numpy as np
import scipy.fft

from identification.words import Integers, Real, UsageError
from mbmodel.modes.matrix_modes import Modes

_MIN_RECORD_PERIODS = 4  # one settles, and three tell noise
_SETTLED_SHARE = 1e-3  # of a transient, after the period that settles
_MAX_UNSETTLED = 0.02  # of a transient: beyond it, the user is told
# Where the modes allow it, a twelfth of the time settles, and lines are near enough to each other
# to show sharp modes that the model lacks; more of them would only take time to compute.
_USUAL_PERIODS, _USUAL_LINES = 12, 400
_MIN_EXCITED_LINES = 20  # of the band: fewer show no modes
RATE_OVER_BAND = 5.0  # images of a held command count above a fifth of the rate
_MIN_RATE_OVER_BAND = 2.5  # readers use lines below 0.8 of half the rate


@dataclass(frozen=True, eq=False)
class RecordPlan:
    """A record of several realisations, one after the other, each of equal periods.

    Args:
        rate_hz: samples per second.
        samples: of a period.
        periods: of a realisation, with the first one, which settles.
        realisations: signals of the record.
        lines: numbers of the lines, 1 for one oscillation a period; (n_freq,).
        remarks: sentences on periods that are too short.
    """

    rate_hz: float
    samples: int
    periods: int
    realisations: int
    lines: Integers
    remarks: tuple[str, ...] = ()

    @property
    def period_s(self) -> float:
        """Length of a period [s]."""
        return self.samples / self.rate_hz

    @property
    def freq_hz(self) -> Real:
        """Lines [Hz]; (n_freq,)."""
        return np.asarray(self.lines / self.period_s)

    @property
    def averages(self) -> int:
        """Periods that count, of all realisations."""
        return self.realisations * (self.periods - 1)

    @property
    def counted_s(self) -> float:
        """Time of these [s]."""
        return self.averages * self.period_s

    @property
    def seconds(self) -> float:
        """Length of the record [s]."""
        return self.realisations * self.periods * self.period_s


def plan_record(
    modes: Modes, band: tuple[float, float], seconds: float, rate_hz: float, drives: int
) -> RecordPlan:
    """Choose the period: the sharpest mode rings down within one, and has lines within it.

    A mode of decay rate d [rad/s] falls to a thousandth within ln(1000) / d. Its half-power
    bandwidth d / pi then holds two lines.

    Args:
        modes: of the machine in its loops.
        band: lowest and highest frequency [Hz].
        seconds: length of the record, at most.
        rate_hz: samples per second.
        drives: number of drives, each with as many realisations.

    Raises:
        UsageError: band, rate or time do not fit one another.
    """
    low, high = band
    if not 0 < low < high:
        raise UsageError(f"--band {low:g} {high:g}: give LOW above 0 and below HIGH")
    if rate_hz < _MIN_RATE_OVER_BAND * high:
        raise UsageError(
            f"--rate {rate_hz:g}: records show frequencies up to 0.4 of the rate: give at least "
            f"{_MIN_RATE_OVER_BAND * high:g}, or a lower --band"
        )
    inside = modes.oscillates & (modes.freq_hz >= low) & (modes.freq_hz <= high)
    decay = -modes.poles.real[inside]
    slowest = float(decay[decay > 0].min(initial=np.inf))
    fine = min(seconds / (drives * _USUAL_PERIODS), _USUAL_LINES / (high - low))
    rings = -np.log(_SETTLED_SHARE) / slowest
    wanted = max(rings, fine, _MIN_EXCITED_LINES / (high - low), 1 / low)
    longest = int(seconds * rate_hz) // (drives * _MIN_RECORD_PERIODS)
    samples = _fast_even_length(min(int(np.ceil(wanted * rate_hz)), longest), longest)
    period_s = samples / rate_hz
    lines = np.arange(int(np.ceil(low * period_s)), int(high * period_s) + 1)
    if len(lines) < _MIN_EXCITED_LINES:
        needed = drives * _MIN_RECORD_PERIODS * _MIN_EXCITED_LINES / (high - low)
        raise UsageError(
            f"--seconds {seconds:g}: a period of {period_s:.3g} s has {len(lines)} lines in the "
            f"band: give at least {np.ceil(needed):g} s, or a wider --band"
        )
    periods = int(seconds * rate_hz) // (drives * samples)
    remarks = _ringing_remark(slowest, period_s, drives)
    return RecordPlan(rate_hz, samples, periods, drives, lines, remarks)


def _ringing_remark(decay: float, period_s: float, drives: int) -> tuple[str, ...]:
    """Return a remark if the sharpest mode has not rung down after the period that settles."""
    remains = float(np.exp(-decay * period_s))
    if remains <= _MAX_UNSETTLED:
        return ()
    needed = drives * _MIN_RECORD_PERIODS * -np.log(_SETTLED_SHARE) / decay
    return (
        f"the sharpest mode rings on: {100 * remains:.2g} % of what begins with a realisation is "
        f"left after the period of {period_s:.3g} s that settles: give --seconds "
        f"{np.ceil(needed):g}",
    )


def _fast_even_length(wanted: int, longest: int) -> int:
    """Return an even number of samples of which transforms are fast, near a wanted one."""
    half = scipy.fft.next_fast_len(max(wanted // 2, 1), real=True)
    if 2 * half > longest:
        half = scipy.fft.prev_fast_len(max(longest // 2, 1), real=True)
    return 2 * int(half)
