"""Modes at rising levels: whether they change beyond chance, and which changes most clearly.

Which effect changes them is not decided here: play, friction and springs that harden move modes
alike under hits. ``mbw diagnose`` compares them with the FRFs themselves. How a change grows with
the level A is a hint all the same. With a shift a (A^p - A_1^p) of the frequency, hysteresis has
p = 1 (Rayleigh 1887) and gradual slip 0 < p < 1 (Segalman 2005), both from the lowest level on, and
both dissipate more at higher levels. A cubic spring has p = 2 and dissipates no more. A gap or a
single sliding element changes nothing below its threshold (p far above 2), and tends to a limit far
beyond it (p < 0).

Visits to a level: the tests of one level that were made one after the other.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from identification.words import Campaign, Input, Output, Real, Test


@dataclass(frozen=True)
class LevelCheckSettings:
    """Thresholds of the level check.

    Args:
        max_chance: probability that any quantity of a linear machine seems to change.
        min_frequency_change: relative; smaller changes do not matter.
        min_damping_change: relative to the damping ratio.
        hysteresis_exponents: growth of a shift with the level: above a limit (0), and below the
            middle between hysteresis (1) and a cubic spring (2).
    """

    max_chance: float = 1e-3
    min_frequency_change: float = 5e-4
    min_damping_change: float = 0.02
    hysteresis_exponents: tuple[float, float] = (0.0, 1.5)


LEVEL_CHECK_SETTINGS = LevelCheckSettings()
NO_CHANGE = "no mode changes beyond its interval"
HYSTERESIS_SENTENCE = (
    "Frequencies fall from the lowest level on, no faster than the level rises, as hysteresis or "
    "gradual friction in joints or actuators makes them; a gap has a threshold, and a cubic spring "
    "follows the square of the level."
)
_EXPONENTS = np.linspace(-2.0, 6.0, 321)  # p that are tried; beyond, a shift is a step


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
        return self.freq_hz / self.freq_hz[0] - 1

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
    return float(chdtrc(len(values) - 1, (weights * (values - mean) ** 2).sum()))


def is_like_hysteresis(trends: Sequence[ModeTrend]) -> bool:
    """Return whether modes change with the level as hysteresis or gradual slip makes them change.

    Most frequencies that change fall, with an exponent of hysteresis, and no less damping ratios
    rise than fall. It needs three levels.

    Args:
        trends: modes at the levels.
    """
    chance = LEVEL_CHECK_SETTINGS.max_chance / max(2 * len(trends), 1)
    changed = [(trend, *trend.changes(chance)) for trend in trends]
    moving = [trend for trend, has_moved, _ in changed if has_moved]
    if not moving or len(moving[0].level) < 3:
        return False
    low, high = LEVEL_CHECK_SETTINGS.hysteresis_exponents
    alike = [
        trend
        for trend in moving
        if trend.frequency_shift[-1] < 0 and low < growth_exponent(trend) < high
    ]
    loss = sum(np.sign(trend.damping[-1] - trend.damping[0]) for trend, _, lost in changed if lost)
    return 2 * len(alike) > len(moving) and bool(loss >= 0)


def growth_exponent(trend: ModeTrend) -> float:
    """Return the exponent p of a shift a (A^p - A_1^p) of the frequency, by least squares.

    Args:
        trend: mode at three levels or more.
    """
    shift, ratio = trend.frequency_shift, trend.level / trend.level[0]
    weight = (trend.freq_hz[0] / trend.freq_sd) ** 2
    weight = weight / weight.sum()

    def misfit(exponent: float) -> float:
        growth = np.log(ratio) if abs(exponent) < 1e-9 else (ratio**exponent - 1) / exponent
        shape = np.stack([growth, np.ones_like(growth)], axis=1) * np.sqrt(weight)[:, None]
        values = shift * np.sqrt(weight)
        solution = np.linalg.lstsq(shape, values, rcond=None)[0]
        return float(((values - shape @ solution) ** 2).sum())

    return float(_EXPONENTS[np.argmin([misfit(float(exponent)) for exponent in _EXPONENTS])])


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


def group_visits(campaign: Campaign) -> list[tuple[float | None, Campaign]]:
    """Return the tests of each visit to a level, in the order of the campaign.

    Tests that state no level are at one unknown level. A test joins the first visit to its level
    that it continues, as another direction or set-up; one that measures the same again begins a
    further visit.
    """
    visits: list[tuple[float | None, list[Test]]] = []
    for test in campaign.tests:
        level = test.condition.level_n
        for known, tests in visits:
            if known == level and _is_continued(tests, test):
                tests.append(test)
                break
        else:
            visits.append((level, [test]))
    return [(level, replace(campaign, tests=tuple(tests))) for level, tests in visits]


def _is_continued(visited: Sequence[Test], test: Test) -> bool:
    """Return whether a test adds channels to a visit and measures none again in its set-up.

    Set-ups may share a sensor, such as one at a fixed reference.
    """
    cells = _list_cells([test])
    same_setup = [known for known in visited if known.condition.setup == test.condition.setup]
    return not cells & _list_cells(same_setup) and not cells <= _list_cells(visited)


def _list_cells(tests: Sequence[Test]) -> set[tuple[Output, Input]]:
    """Return the channels and references of tests, along positive axes."""
    return {
        (dof.positive, test.condition.reference.positive)
        for test in tests
        for dof in test.estimate.frf.outputs
    }
