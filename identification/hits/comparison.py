r"""Comparison of a hit with FRFs of a model and with other hits: place, direction, channels.

Force F and motion X of a hit are compared with the FRFs ``H_r`` of each place and direction that
may have been hit, along both signs, by the relative error

    e_r = |X - H_r F| / |X|        at s = i w + 1/tau,

the norm over lines and channels. Force and motion have the exponential window (``windows``). Over
the time of the pulse the response depends on the inertia that is hit more than on springs and
dampers, so that the model need not be tuned to tell places apart. A hit is refused for what
explains it, never for a deviation alone: a model that lacks something deviates too.

Channels are compared by the correlation c = Re sum X_k P_k* / (|X_k| |P_k|) with what is expected,
P = H_s F, or that of another hit: -1 is a turned channel, and two channels are exchanged if each
has that of the other one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.hits.blocks import Blocks
from identification.hits.outliers import MIN_EXCITATION
from identification.hits.windows import exponential_windows, force_windows
from identification.words import Complex, Dof, Mask, Output, Real

_LENGTH_TAUS = 10  # length of the compared signals: the window has then fallen by exp(-10)
_USABLE_RATE_SHARE = 0.4  # of the sampling rate: anti-aliasing filters act above
_MAX_EQUAL_ERROR = 0.3  # of two hits at one place: scatter of the aim gives a tenth of it
_MAX_ERROR_RATIO = 0.7  # of the best other place over the stated one, for a wrong place
_MAX_MEASURED_ERROR = 0.15  # from the hits at another place, for a hit that was made there
_MIN_MOVING_SHARE = 0.1  # of the largest expected motion: less may be transverse, or noise
_MIN_AGREEMENT = 0.85  # median correlation over channels: with less, nothing is said of one channel
_MIN_FAULT_CORRELATION = 0.6  # with the expected motion, below which a channel is turned
_MIN_ERROR_RATIO = 3.0  # of two exchanged channels over the median channel
_MAX_EXCHANGED_ERROR = 0.5  # of their error as stated
_MAX_DEAD_SHARE = 0.1  # of the expected motion
_NOISE_CHANGE = 10.0  # of the rms before the hit over the channel's usual one, for a loose cable
_MIN_USUAL_HITS = 3  # for that usual one
_MIN_NOISE_SHARE = 0.005  # of the largest motion of the hit: less noise spoils no FRF
_MIN_SAMPLES_BEFORE_HIT = 8  # before a hit, for that rms
_FILTER_WIDTHS = 4  # pulse widths before a hit that are left out

DEAD = "seems dead: look at its cable"
TURNED, EXCHANGED = "reads with the opposite sign", "are exchanged"
LOOSE = "has other noise before the hit than usual: look at its cable"
Fault = tuple[str, tuple[int, ...]]  # what is wrong, and the channels
Places = Mapping[Dof, Complex]  # FRFs of places and directions; (n_freq, n_out) each


@dataclass(frozen=True)
class CompareWindow:
    """Lines and exponential window of a comparison, for all hits of a test.

    Args:
        tau: time constant of the window [s].
        rate_hz: samples per second of all hits [Hz].
    """

    tau: float
    rate_hz: float

    @property
    def samples(self) -> int:
        """Number of samples of the compared signals."""
        return int(np.ceil(_LENGTH_TAUS * self.tau * self.rate_hz)) + 2

    @property
    def freq_hz(self) -> Real:
        """Frequencies above 0 Hz that anti-aliasing filters leave [Hz]; (n_freq,)."""
        lines = np.fft.rfftfreq(self.samples, 1 / self.rate_hz).astype(np.float64)
        return lines[(lines > 0) & (lines <= _USABLE_RATE_SHARE * self.rate_hz)]


@dataclass(frozen=True, eq=False)
class ComparedHit:
    """Spectra of one hit on the lines of a comparison.

    Args:
        force: F; (n_freq,).
        motion: X; (n_freq, n_out).
    """

    force: Complex
    motion: Complex

    @property
    def frf(self) -> Complex:
        """FRFs of this hit alone; (n_freq, n_out)."""
        return np.asarray(self.motion / self.force[:, None], np.complex128)

    @cached_property
    def is_excited(self) -> Mask:
        """Lines with enough force; (n_freq,)."""
        size = np.abs(self.force)
        return np.asarray(size >= MIN_EXCITATION * size.max())

    def error(self, frf: Complex) -> float:
        """Return e of FRFs; (n_freq, n_out)."""
        lines = self.is_excited
        motion = self.motion[lines]
        rest = motion - frf[lines] * self.force[lines, None]
        return float(np.linalg.norm(rest) / max(np.linalg.norm(motion), np.finfo(float).tiny))


def compared_hits(blocks: Blocks, window: CompareWindow) -> list[ComparedHit]:
    """Return the spectra of each hit of some blocks with the window of a comparison."""
    weights = exponential_windows(blocks, window.tau)
    force = blocks.force * force_windows(blocks, None) * weights
    motion = blocks.motion * weights[:, None]
    count, n_freq = window.samples, len(window.freq_hz)
    hits = []
    for row, (blow, start) in enumerate(zip(blocks.blows, blocks.starts, strict=True)):
        first = max(blow.onset - start - blow.main.width, 0)
        part = slice(first, first + count)
        spectra = np.fft.rfft(np.vstack([force[row, None, part], motion[row, :, part]]), count)
        chosen = spectra[:, 1 : n_freq + 1]
        hits.append(ComparedHit(chosen[0], np.ascontiguousarray(chosen[1:].T)))
    return hits


def find_other_place(
    hits: tuple[ComparedHit, ComparedHit],
    stated: Dof,
    model: Places,
    companions: Sequence[Complex],
    measured: Places,
) -> Dof | None:
    """Return the place and direction that explains a hit better than the stated one, or None.

    Args:
        hits: spectra of the hit with the window of the model, and with that of other hits.
        stated: where it was said to be.
        model: FRFs of the model for each place and direction that may have been hit; may be empty.
        companions: FRFs of other hits at the stated place.
        measured: FRFs of hits elsewhere.
    """
    hit, beside_others = hits
    equal = [beside_others.error(frf) < _MAX_EQUAL_ERROR for frf in companions]
    if len(equal) > 1 and sum(equal) > len(equal) / 2:
        return None
    errors = _errors_of_places(hit, model)
    stated_error = min([errors.get(stated, 1.0), *(beside_others.error(frf) for frf in companions)])
    errors.pop(stated, None)
    if stated in model and model[stated].any() and errors:
        best = min(errors, key=lambda dof: errors[dof])
        if errors[best] < _MAX_ERROR_RATIO * stated_error:
            return best
    elsewhere = _errors_of_places(beside_others, measured)
    elsewhere.pop(stated, None)
    nearest = min(elsewhere, key=lambda dof: elsewhere[dof], default=None)
    if nearest is None or elsewhere[nearest] > _MAX_MEASURED_ERROR:
        return None
    return nearest if elsewhere[nearest] < _MAX_ERROR_RATIO**2 * stated_error else None


def _errors_of_places(hit: ComparedHit, places: Places) -> dict[Dof, float]:
    """Return e of each place along both signs."""
    errors = {}
    for dof, frf in places.items():
        errors[dof] = hit.error(frf)
        errors[Dof.of(dof.point, dof.axis, -dof.sign)] = hit.error(-frf)
    return errors


class ChannelComparison:
    """Channels of a hit beside the motion that FRFs would give.

    Args:
        hit: spectra of the hit.
        frf: FRFs of the model, or of another hit; (n_freq, n_out).
    """

    def __init__(self, hit: ComparedHit, frf: Complex) -> None:
        lines = hit.is_excited
        expected, motion = frf[lines] * hit.force[lines, None], hit.motion[lines]
        self._sizes = np.linalg.norm(motion, axis=0)
        self._wanted = np.linalg.norm(expected, axis=0)
        self._cross: Real = (motion.T @ expected.conj()).real  # of motion k with expected l
        squares = self._sizes[:, None] ** 2 + self._wanted**2
        self._errors: Real = np.maximum(squares - 2 * self._cross, 0.0)
        is_shown = self._wanted > _MIN_MOVING_SHARE * self._wanted.max(initial=0.0)
        self.channels = frozenset(np.flatnonzero(is_shown).tolist())
        agreements = np.diag(self._correlations)[is_shown]
        if not agreements.size or float(np.median(agreements)) < _MIN_AGREEMENT:
            self.channels = frozenset()

    @property
    def _correlations(self) -> Real:
        scale = np.maximum(np.outer(self._sizes, self._wanted), np.finfo(float).tiny)
        return self._cross / scale

    def find_faults(self) -> set[Fault]:
        """Return turned, exchanged and dead channels."""
        agreements, shown = np.diag(self._correlations), np.array(sorted(self.channels), np.intp)
        if not shown.size:
            return set()
        is_dead = self._sizes < _MAX_DEAD_SHARE * self._wanted
        faults: set[Fault] = {(DEAD, (k,)) for k in shown[is_dead[shown]].tolist()}
        turned = shown[(agreements[shown] < -_MIN_FAULT_CORRELATION) & ~is_dead[shown]]
        faults |= {(TURNED, (k,)) for k in turned.tolist()}
        stated = np.diag(self._errors)[shown]
        typical = float(np.median(stated / self._wanted[shown] ** 2))
        among = self._errors[np.ix_(shown, shown)]
        pairs = np.add.outer(stated, stated)
        size = np.add.outer(self._wanted[shown] ** 2, self._wanted[shown] ** 2)
        is_odd = pairs > _MIN_ERROR_RATIO**2 * typical * size
        ratio = (among + among.T) / np.maximum(pairs, np.finfo(float).tiny)
        used = {channel for _, (channel,) in faults}
        for place in np.argsort(ratio, axis=None).tolist():  # the best explanation first
            row, column = divmod(place, len(shown))
            pair = int(shown[row]), int(shown[column])
            if ratio[row, column] > _MAX_EXCHANGED_ERROR**2:
                break
            if row < column and is_odd[row, column] and not used & set(pair):
                faults.add((EXCHANGED, pair))
                used |= set(pair)
        return faults

    def leans_to(self, fault: Fault) -> bool:
        """Return whether a fault fits better than none."""
        what, (first, *rest) = fault
        if what == DEAD:
            return bool(self._sizes[first] < self._wanted[first] / 2)
        if what == TURNED:
            return bool(self._cross[first, first] < 0)
        errors, (second,) = self._errors, rest
        stated = errors[first, first] + errors[second, second]
        return bool(errors[first, second] + errors[second, first] < stated)


def describe_fault(fault: Fault, outputs: Sequence[Output]) -> str:
    """Return a fault of channels as part of a sentence."""
    what, channels = fault
    return f"{' and '.join(str(outputs[k]) for k in channels)} {what}"


def quiet_levels(blocks: Blocks) -> Real:
    """Return the rms of each channel before each hit over the largest motion; (n_hit, n_out).

    It is NaN without samples. Anti-aliasing filters may ring before a hit.
    """
    levels = np.full(blocks.motion.shape[:2], np.nan)
    for row, (blow, start) in enumerate(zip(blocks.blows, blocks.starts, strict=True)):
        count = blow.onset - start - _FILTER_WIDTHS * blow.main.width
        if count >= _MIN_SAMPLES_BEFORE_HIT:
            largest = max(float(np.abs(blocks.motion[row]).max()), np.finfo(float).tiny)
            levels[row] = blocks.motion[row, :, :count].std(axis=1) / largest
    return levels


def find_loose_channels(level: Real, usual: Real) -> list[int]:
    """Return the channels that are far noisier before a hit than they usually are.

    Args:
        level: noise of each channel before the hit; (n_out,).
        usual: that before all hits; (n_hit, n_out).
    """
    usual = usual[np.isfinite(usual).all(axis=1)]
    if len(usual) < _MIN_USUAL_HITS or not np.isfinite(level).all():
        return []
    change = level / np.maximum(np.median(usual, axis=0), np.finfo(float).tiny)
    change /= max(float(np.median(change)), 1.0)  # the machine may still move from the last hit
    return np.flatnonzero((change > _NOISE_CHANGE) & (level > _MIN_NOISE_SHARE)).tolist()
