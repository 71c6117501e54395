"""Modes at rising levels: whether they change beyond chance, and which changes most clearly.

Which effect changes them is not decided here: play, friction and springs that harden move modes
alike under hits. ``mbw diagnose`` compares them with the FRFs themselves.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from identification.words import Real


@dataclass(frozen=True)
class LevelCheckSettings:
    """Thresholds of the level check.

    Args:
        max_chance: probability that any quantity of a linear machine seems to change.
        min_frequency_change: relative; smaller changes do not matter.
        min_damping_change: relative to the damping ratio.
    """

    max_chance: float = 1e-3
    min_frequency_change: float = 5e-4
    min_damping_change: float = 0.02


LEVEL_CHECK_SETTINGS = LevelCheckSettings()
NO_CHANGE = "no mode changes beyond its interval"


@dataclass(frozen=True, eq=False)
class ModeTrend:
    """Frequency and damping of a mode at rising levels.

    Args:
        level: peak force [N], or amplitude of the decaying motion; (n_level,).
        freq_hz, freq_sd: natural frequency and its standard deviation [Hz]; (n_level,).
        damping, damping_sd: damping ratio and its standard deviation; (n_level,).
    """

    level: Real
    freq_hz: Real
    freq_sd: Real
    damping: Real
    damping_sd: Real

    @property
    def frequency_shift(self) -> Real:
        """Relative shift of the frequency from the lowest level; (n_level,)."""
        shift: Real = self.freq_hz / self.freq_hz[0] - 1
        return shift

    @property
    def sentence(self) -> str:
        """Change of the mode from the lowest level to the highest, in one sentence."""
        return (
            f"The mode at {self.freq_hz[0]:.4g} Hz changes by {100 * self.frequency_shift[-1]:+.2g}"
            f" % in frequency, and from {100 * self.damping[0]:.3g} to "
            f"{100 * self.damping[-1]:.3g} % in damping."
        )

    def changes(self, chance: float) -> tuple[bool, bool]:
        """Return whether frequency and damping change with the level.

        Args:
            chance: probability that either of a linear machine seems to change.
        """
        settings = LEVEL_CHECK_SETTINGS
        has_moved = (
            np.ptp(self.freq_hz) > settings.min_frequency_change * self.freq_hz[0],
            np.ptp(self.damping) > settings.min_damping_change * self.damping[0],
        )
        chances = (
            compute_chance_of_constancy(self.freq_hz, self.freq_sd),
            compute_chance_of_constancy(self.damping, self.damping_sd),
        )
        first, second = (bool(m and p < chance) for m, p in zip(has_moved, chances, strict=True))
        return first, second


def compute_chance_of_constancy(values: Real, deviations: Real) -> float:
    """Return the probability that equal values scatter at least as much as these.

    Args:
        values: measured values; (n,).
        deviations: their standard deviations; (n,).
    """
    weights = 1 / np.maximum(deviations, 1e-12 * np.abs(values).max()) ** 2
    mean = (weights * values).sum() / weights.sum()
    return float(chi2.sf((weights * (values - mean) ** 2).sum(), len(values) - 1))


def find_clearest_trend(trends: Sequence[ModeTrend]) -> ModeTrend | None:
    """Return the mode whose change with the level is the most significant; None without one.

    Args:
        trends: modes at two levels or more.
    """
    changes = _list_changes(trends)
    if not changes:
        return None
    return max(changes, key=lambda mode: mode.weight * np.hypot(mode.shift, mode.loss)).trend


def _list_changes(trends: Sequence[ModeTrend]) -> "list[_ModeChange]":
    """Return the changes of all modes that change."""
    chance = LEVEL_CHECK_SETTINGS.max_chance / max(2 * len(trends), 1)
    changes = (_measure_change(trend, chance) for trend in trends)
    return [change for change in changes if change is not None]


@dataclass(frozen=True, eq=False)
class _ModeChange:
    """Change of a mode with the level.

    Args:
        trend: the mode.
        shift: relative change of its frequency.
        loss: change of its damping ratio.
        weight: one over the variance of both.
    """

    trend: ModeTrend
    shift: float
    loss: float
    weight: float


def _measure_change(trend: ModeTrend, chance: float) -> _ModeChange | None:
    """Return the change of a mode; None if it does not change.

    A joint moves the frequency one way as the level rises. Where it turns back, the mode was
    followed badly, or is none: that counts as a deviation.

    Args:
        trend: the mode.
        chance: probability that either quantity of a linear machine seems to change.
    """
    has_frequency, has_damping = trend.changes(chance)
    if not (has_frequency or has_damping):
        return None
    relative = trend.frequency_shift
    shift, shift_sd = _find_largest_change(relative, trend.freq_sd / trend.freq_hz[0])
    loss, loss_sd = _find_largest_change(trend.damping, trend.damping_sd)
    variance = shift_sd**2 + loss_sd**2 + _measure_reversal(relative) ** 2
    return _ModeChange(
        trend, shift * has_frequency, loss * has_damping, 1 / max(variance, np.finfo(float).tiny)
    )


def _find_largest_change(values: Real, deviations: Real) -> tuple[float, float]:
    """Return the most significant change between a level and a higher one, and its deviation."""
    lower, upper = np.triu_indices(len(values), 1)
    change = values[upper] - values[lower]
    deviation = np.hypot(deviations[upper], deviations[lower])
    clearest = np.abs(change / deviation).argmax()
    return float(change[clearest]), float(deviation[clearest])


def _measure_reversal(values: Real) -> float:
    """Return how far values turn back from a steady rise or fall, whichever is nearer."""
    drop = np.maximum.accumulate(values) - values
    rise = values - np.minimum.accumulate(values)
    return float(min(drop.max(), rise.max()))
