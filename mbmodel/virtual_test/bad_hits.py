"""Bad hits of a virtual test, of the kinds that a test repeats: hammer, place, channels, cables."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.words import Dof, Real, UsageError
from mbmodel.virtual_test.hits import Hits, draw_bounces

KINDS = (
    *("double", "weak", "overload", "wrong point", "wrong direction"),
    *("turned channel", "swapped channels", "loose cable"),
)
_WEAK_SHARE = (0.03, 0.15)  # of the planned peak
_OVERLOAD_SHARE = (3.0, 6.0)  # of the planned peak
_RANGE_OF_USUAL = 1.3  # range of the channels over the largest motion of a usual hit
_LOOSE_NOISE_SHARE = 0.1  # of the channel's largest motion: rms of a cable that crackles
_DEAD_GAIN = 1e-3  # of a cable that carries nothing but crosstalk
# Kinds that act on channels, and on how many.
_CHANNELS = {"overload": 0, "turned channel": 1, "swapped channels": 2, "loose cable": 1}
_MIN_MOTION_SHARE = 0.1  # of the largest channel: faults of others would not show


@dataclass(frozen=True)
class BadHit:
    """Fault of a hit.

    Args:
        kind: one of ``KINDS``.
        struck: where the hammer hit; the planned place and direction for most kinds.
        channels: numbers of the channels that are wrong.
        share: peak force over the planned one, where it differs; else 0.
        is_dead: whether a loose cable carries nothing, in place of crackling.
    """

    kind: str
    struck: Dof
    channels: tuple[int, ...] = ()
    share: float = 0.0
    is_dead: bool = False


def draw_bad_hits(
    count: int, share: float, reference: Dof, planned: Sequence[Dof], random: np.random.Generator
) -> list[BadHit | None]:
    """Draw which hits along one direction are bad, and how; None for good ones.

    Bad ones come in addition to those that are planned.

    Args:
        count: number of planned hits.
        share: share of bad ones among all hits.
        reference: planned place and direction.
        planned: all places and directions of the test.
    """
    hits: list[BadHit | None] = []
    while hits.count(None) < count:
        is_bad = random.uniform() < share
        hits.append(_draw(reference, planned, random) if is_bad else None)
    return hits


def _draw(reference: Dof, planned: Sequence[Dof], random: np.random.Generator) -> BadHit:
    """Draw one bad hit, of a kind that the test can have."""
    points = [dof for dof in planned if dof.point != reference.point]
    kinds = [kind for kind in KINDS if points or kind != "wrong point"]
    kind = kinds[int(random.integers(len(kinds)))]
    share = {"weak": _WEAK_SHARE, "overload": _OVERLOAD_SHARE}.get(kind, (0.0, 0.0))
    struck = reference
    if kind == "wrong point":
        struck = points[int(random.integers(len(points)))]
    if kind == "wrong direction":
        axis = (reference.axis + int(random.integers(3))) % 3
        sign = -reference.sign if axis == reference.axis else int(random.choice([-1, 1]))
        struck = Dof.of(reference.point, axis, sign)
    is_dead = bool(random.uniform() < 0.5)
    return BadHit(kind, struck, (), float(random.uniform(*share)), is_dead)


def spoil_hits(hits: Hits, bad: Sequence[BadHit | None], random: np.random.Generator) -> Hits:
    """Return hits with the weak, too strong and double ones among them.

    Args:
        hits: good hits; n_hit.
        bad: what is wrong with each; n_hit.
    """
    kinds = np.array(["" if each is None else each.kind for each in bad])
    shares = np.array([each.share if each is not None and each.share else 1.0 for each in bad])
    peaks, onsets = hits.peaks * shares[:, None], hits.onsets.copy()
    is_double = kinds == "double"
    heights, delays = draw_bounces(len(bad), random)
    peaks[is_double, 1] = (peaks[:, 0] * heights)[is_double]
    onsets[is_double, 1] = (onsets[:, 0] + hits.widths[:, 0] * delays)[is_double]
    return replace(hits, peaks=peaks, onsets=onsets)


def spoil_channels(
    motion: Real, bad: Sequence[BadHit | None], random: np.random.Generator
) -> tuple[Real, list[BadHit | None]]:
    """Return the motion as wrong channels record it, and the bad hits with these channels.

    Args:
        motion: motion; (n_hit, n_out, n_sample).
        bad: what is wrong with each hit; n_hit.
    """
    recorded, rows = motion.copy(), list(bad)
    for number, fault in enumerate(bad):
        if fault is None or fault.kind not in _CHANNELS:
            continue
        record = recorded[number]
        largest = np.abs(record).max(axis=1)
        shown = np.flatnonzero(largest > _MIN_MOTION_SHARE * largest.max())
        if len(shown) < _CHANNELS[fault.kind]:
            raise UsageError("a test of one channel has none to exchange: give more channels")
        chosen = random.permutation(shown)[: _CHANNELS[fault.kind]]
        if fault.kind == "overload":
            limit = _RANGE_OF_USUAL / fault.share * largest.max()
            chosen = np.flatnonzero(largest > limit)
            record[:] = np.clip(record, -limit, limit)
        elif fault.kind == "turned channel":
            record[chosen] *= -1
        elif fault.kind == "swapped channels":
            record[chosen] = record[chosen[::-1]]
        elif fault.is_dead:
            record[chosen] *= _DEAD_GAIN
        else:
            noise = _LOOSE_NOISE_SHARE * largest[chosen]
            record[chosen] += noise * random.standard_normal(record[chosen].shape)
        rows[number] = replace(fault, channels=tuple(chosen.tolist()))
    return recorded, rows
