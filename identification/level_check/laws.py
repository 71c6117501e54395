r"""Laws that explain how modes change with the level of motion.

A joint whose force is g(q) has, at the amplitude A of its motion, the stiffness k(A) and the loss
h(A) of its describing function (Gelb and Vander Velde 1968). A mode then shifts by

    df / f = (k(A) - k(0)) / (2 K),    dz = h(A) / (2 K),

K a stiffness of the mode alone, so that dz / (df / f) = h / (k - k(0)) tells the law:

| law | k with A | h over the drop of k |
|---|---|---|
| hardening | rises | 0 |
| centred gap | rises from nothing, then settles | 0 |
| softening, gap with a preload | falls | 0 |
| Jenkins element, for A = 1.2, 2, 4, 10 times the slip | falls | 1.3, 0.64, 0.30, 0.12 |
| dry friction that slides | stays | falls as 1 / A |

Under hits, a motion that decays sweeps over frequency. Its FRFs seem to have more damping then: by
up to 0.14 of the shift, for cubic springs and gaps. Iwan, LuGre and Bouc-Wen models of friction are
sets of Jenkins elements or nearly so; modes cannot tell them apart.
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
        min_friction_loss: rise of the damping ratio over the relative drop of the frequency from
            which friction alone explains both.
        min_pure_loss: rise of the damping ratio over the relative rise of the frequency beyond
            which the damping is the finding, and the frequency drifts.
    """

    max_chance: float = 1e-3
    min_frequency_change: float = 5e-4
    min_damping_change: float = 0.02
    min_friction_loss: float = 0.22
    min_pure_loss: float = 0.6


LEVEL_CHECK_SETTINGS = LevelCheckSettings()


@dataclass(frozen=True)
class LevelLaw:
    """Laws that explain a change with the level.

    Args:
        effects: names of effects that the data cannot tell apart, most likely first; none where the
            modes do not change.
        words: what the modes do, and which laws do that.
    """

    effects: tuple[str, ...]
    words: str


LINEAR = LevelLaw((), "no mode changes with the level")
_FRICTION = LevelLaw(
    ("friction",),
    "friction-like: a Jenkins, Iwan, LuGre or Bouc-Wen element, which modes cannot tell apart",
)
_SLIDING = LevelLaw(("friction",), "damping falls with the level: dry friction that slides")
_HARDENING = LevelLaw(("hardening",), "stiffness rises with the level: hardening")
_STIFFENING = LevelLaw(
    ("backlash", "hardening"),
    "stiffness rises with the level: a centred gap or hardening",
)
_SOFTENING = LevelLaw(
    ("backlash", "hardening"),
    "stiffness falls with the level and damping hardly rises: a gap with a preload, or softening",
)


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


def name_law(trends: Sequence[ModeTrend]) -> LevelLaw:
    """Return the law that explains how modes change with the level.

    The shifts of all modes that change are averaged, each weighted by its precision: one joint
    moves several modes, each by the same law but by another share.

    Args:
        trends: modes at two levels or more.
    """
    settings = LEVEL_CHECK_SETTINGS
    changes = _list_changes(trends)
    if not changes:
        return LINEAR
    weight = np.array([change.weight for change in changes])
    shift = float(weight @ [change.shift for change in changes])
    loss = float(weight @ [change.loss for change in changes])
    if loss > settings.min_pure_loss * abs(shift):
        return _FRICTION
    if shift > 0:
        trend = max(changes, key=lambda change: change.weight * change.shift).trend
        return _HARDENING if _is_convex(trend.level, trend.frequency_shift) else _STIFFENING
    if shift == 0 or -loss > settings.min_pure_loss * abs(shift):
        return _SLIDING
    return _FRICTION if loss > -settings.min_friction_loss * shift else _SOFTENING


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

    Every law moves the frequency one way as the level rises. Where it turns back, the mode was
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


def _is_convex(level: Real, shift: Real) -> bool:
    """Return whether a shift grows faster than the level, as that of a cubic spring.

    A cubic spring is linear at small levels; a centred gap changes most there.
    """
    if len(level) < 3:
        return False
    rates = np.diff(shift) / np.diff(level)
    return bool(rates[-1] > rates[0])
