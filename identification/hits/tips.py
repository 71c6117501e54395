"""Comparison of hammer tips: which tip puts its force into which band (seed, ch. 1.1).

A hit is a transient with an energy, so tips are compared by the energy spectral density of their
force, E(f) = 2 |F(f)|^2 with F = dt sum f exp(-i w t), mean over the averaged hits. In contrast to
the density of power it does not depend on the length of the block.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from scipy.ndimage import median_filter

from identification.words import Campaign, Real, Test, frozen_array

MIN_TIP_COHERENCE = 0.9  # median over channels at the ends of a tip's band
MAX_ENERGY_LOSS_DB = 20.0  # of the force below its largest line, at the ends of a tip's band
_ENERGY_SMOOTHING_SHARE = 20  # the comparison of energies is smoothed over 1/20 of its lines
_MIN_SEGMENT_SHARE = 0.05  # of the compared band: shorter segments join their neighbour


@dataclass(frozen=True, eq=False)
class HammerTip:
    """Force and coherence of the tests that one hammer tip made.

    Args:
        name: name of the campaign, with that of the hammer if the campaign has several.
        hits: number of averaged hits, 0 if unknown.
        freq_hz: frequency lines [Hz]; (n_freq,).
        energy: energy spectral density of the force [N^2 s/Hz], zero if unknown; (n_freq,).
        coherence: median over all channels and references, zero if unknown; (n_freq,).
        peak_n: median of the largest forces [N]; None if unknown.
    """

    name: str
    hits: int
    freq_hz: Real
    energy: Real
    coherence: Real
    peak_n: float | None

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freq = frozen_array(self.freq_hz, np.float64, (None,), "freq_hz")
        object.__setattr__(self, "freq_hz", freq)
        for name in ("energy", "coherence"):
            value = frozen_array(getattr(self, name), np.float64, freq.shape, name)
            object.__setattr__(self, name, value)

    @property
    def has_force(self) -> bool:
        """Whether the force is known: it is not where a file holds FRFs."""
        return bool(self.energy.any())

    @property
    def has_coherence(self) -> bool:
        """Whether the coherence is known: it is not for single hits."""
        return bool(self.coherence.any())

    @property
    def force_limit_hz(self) -> float | None:
        """Highest frequency at which the force is within 20 dB of its largest line [Hz]."""
        if not self.has_force:
            return None
        strong = self.energy >= self.energy.max() * 10 ** (-MAX_ENERGY_LOSS_DB / 10)
        return float(self.freq_hz[strong][-1])

    @property
    def band_hz(self) -> tuple[float, float] | None:
        """First and last line with enough force and a median coherence above 0.9 [Hz].

        Where force or coherence is unknown, the other one decides; None if no line has both.
        """
        good = np.ones(len(self.freq_hz), bool)
        if self.has_force:
            good &= self.energy >= self.energy.max() * 10 ** (-MAX_ENERGY_LOSS_DB / 10)
        if self.has_coherence:
            good &= self.coherence > MIN_TIP_COHERENCE
        if not good.any() or not (self.has_force or self.has_coherence):
            return None
        lines = self.freq_hz[good]
        return float(lines[0]), float(lines[-1])


@dataclass(frozen=True)
class StrongestTip:
    """Band in which one tip puts in more energy than every other.

    Args:
        name: name of the tip.
        low_hz, high_hz: ends of the band [Hz].
        gain_db: energy over that of the second strongest tip, median over the band [dB].
    """

    name: str
    low_hz: float
    high_hz: float
    gain_db: float


def campaign_tips(campaign: Campaign) -> tuple[HammerTip, ...]:
    """Return the tips of a campaign: one, or one for each hammer that its tests name."""
    order = sorted(campaign.tests, key=lambda test: test.condition.instrument)
    groups = [list(tests) for _, tests in groupby(order, lambda test: test.condition.instrument)]
    return tuple(
        _tip(f"{campaign.name}: {tests[0].condition.instrument}", tests)
        if len(groups) > 1
        else _tip(campaign.name, tests)
        for tests in groups
    )


def _tip(name: str, tests: Sequence[Test]) -> HammerTip:
    """Return force and coherence of tests, on the lines of the first one."""
    estimates = [test.hits.estimate if test.hits else test.estimate for test in tests]
    freq = estimates[0].frf.freq_hz
    limits = [test.hits.usable_limit_hz for test in tests if test.hits]
    kept = (freq > 0) & (freq <= min(limits, default=np.inf))
    curves = [
        estimate.coherence[:, estimate.measured[:, 0], 0]
        for estimate in estimates
        if estimate.coherence is not None and np.array_equal(estimate.frf.freq_hz, freq)
    ]
    with_force = [
        test.hits
        for test in tests
        if test.hits and np.array_equal(test.hits.densities.freq_hz, freq)
    ]
    energies = [hits.densities.force**2 * hits.block_s for hits in with_force]
    peaks = [abs(hit.peak_n) for hits in with_force for hit in hits.kept]
    return HammerTip(
        name,
        sum(estimate.averages or 0 for estimate in estimates),
        freq[kept],
        np.mean(energies, axis=0)[kept] if energies else np.zeros(kept.sum()),
        np.median(np.hstack(curves), axis=1)[kept] if curves else np.zeros(kept.sum()),
        float(np.median(peaks)) if peaks else None,
    )


def strongest_tips(tips: Sequence[HammerTip]) -> tuple[StrongestTip, ...]:
    """Divide the common band into parts by the tip that puts in the most energy.

    Energies in decibels are interpolated on the lines of the tip with the coarsest ones and
    smoothed by a running median.

    Args:
        tips: tips; those without force are left out.

    Returns:
        Parts by rising frequency; empty for fewer than two tips with force.
    """
    measured = [tip for tip in tips if tip.has_force]
    if len(measured) < 2:
        return ()
    low = max(float(tip.freq_hz[0]) for tip in measured)
    high = min(float(tip.freq_hz[-1]) for tip in measured)
    coarsest = max(measured, key=lambda tip: float(np.diff(tip.freq_hz).mean()))
    freq = coarsest.freq_hz[(coarsest.freq_hz >= low) & (coarsest.freq_hz <= high)]
    if len(freq) < 2:
        return ()
    least = 1e-30 * max(float(tip.energy.max()) for tip in measured)
    width = max(len(freq) // _ENERGY_SMOOTHING_SHARE, 1)
    levels = np.array(
        [
            median_filter(
                np.interp(freq, tip.freq_hz, 10 * np.log10(np.maximum(tip.energy, least))), width
            )
            for tip in measured
        ]
    )
    best = _join_short(levels.argmax(axis=0), max(int(_MIN_SEGMENT_SHARE * len(freq)), 1))
    ends = np.flatnonzero(np.diff(best)) + 1
    parts = []
    for lines in np.split(np.arange(len(freq)), ends):
        tip = int(best[lines[0]])
        rivals = np.delete(levels[:, lines], tip, axis=0).max(axis=0)
        gain = float(np.median(levels[tip, lines] - rivals))
        parts.append(
            StrongestTip(measured[tip].name, float(freq[lines[0]]), float(freq[lines[-1]]), gain)
        )
    return tuple(parts)


def _join_short(best: np.ndarray, shortest: int) -> np.ndarray:
    """Return the strongest tip of each line, with short parts given to the part before them."""
    joined = best.copy()
    start = 0
    for end in [*(np.flatnonzero(np.diff(best)) + 1), len(best)]:
        if end - start < shortest and start > 0:
            joined[start:end] = joined[start - 1]
        start = end
    return joined


def tip_sentence(tip: HammerTip) -> str:
    """Return one sentence on the band that a tip excites."""
    limit, band = tip.force_limit_hz, tip.band_hz
    if limit is None and not tip.has_coherence:
        return f"{tip.name}: neither force nor coherence is known."
    parts = []
    if limit is not None:
        parts.append(f"its force stays within 20 dB of its largest up to {limit:.4g} Hz")
    if not tip.has_coherence:
        parts.append("its coherence is unknown")
    elif band is None:
        parts.append(f"its median coherence nowhere exceeds {MIN_TIP_COHERENCE:g} there")
    else:
        parts.append(
            f"it excites {band[0]:.4g} to {band[1]:.4g} Hz with a median coherence above "
            f"{MIN_TIP_COHERENCE:g}"
        )
    return f"{tip.name}: {'; '.join(parts)}."


def strongest_sentence(parts: Sequence[StrongestTip]) -> str:
    """Return one sentence on which tip puts the most energy into which band."""
    if not parts:
        return ""
    texts = [
        f"{part.name} from {part.low_hz:.4g} to {part.high_hz:.4g} Hz ({part.gain_db:.2g} dB)"
        for part in parts
    ]
    return f"Most energy comes from {', '.join(texts)}."
