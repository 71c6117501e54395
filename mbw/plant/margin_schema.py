"""Rows of stability margins in the JSON file of ``mbw predict``."""

from pydantic import Field

from identification.readers.result_files import ResultRow
from tuning.plant.error_budget.robust_stability import RobustTest


class MarginRow(ResultRow):
    """A margin; null where no change of this kind is critical.

    Args:
        value: of the nominal machine.
        frequency: at which it is taken [Hz].
        low, high: ends of the 95 % interval, by machines of the posterior and the model-error
            floor; null without a posterior.
        worst: of all these machines; null without any.
        floor: standard deviation by the model-error floor, to first order; null without one.
        before: value of the other machine of the budget; null without one.
    """

    value: float | None
    frequency: float | None
    low: float | None
    high: float | None
    worst: float | None
    before: float | None = None
    floor: float | None = None


class CrossoverRow(ResultRow):
    """A crossover: its frequency [Hz] and the margin there [deg, or factor]."""

    frequency: float
    margin: float


class StepRow(ResultRow):
    """Response to a unit step of the reference.

    Args:
        final: value at the end of all time.
        overshoot: largest value above the final one, relative to it.
        rise_time: from 10 to 90 % [s]; null if not reached in 200 periods of the crossover.
        settling_time: until it stays within 2 % [s]; null likewise.
    """

    final: float
    overshoot: float
    rise_time: float | None = Field(validation_alias="rise_time_s")
    settling_time: float | None = Field(validation_alias="settling_time_s")


class LoopMarginsRow(ResultRow):
    """Margins of a loop, all others closed.

    Args:
        loop: name.
        period: sampling period of its controller [s]; null for a continuous one.
        crossover: frequency above which |L| stays below one [Hz].
        bandwidth: frequency at which |S| first rises above 1 / sqrt(2) [Hz].
        gain: factor by which the gain may rise.
        gain_reduction: factor to which it may fall.
        phase: [deg]; negative where phase lead is critical.
        delay: that may be added [s].
        modulus: 1 / max |S|, the distance of L from -1.
        sensitivity_peak: max |S| of the nominal machine.
        gain_crossovers: where |L| = 1, with phase margins [deg].
        phase_crossovers: where L is real and negative, with gain margins.
        worst_machine: number of the machine of the posterior with the smallest modulus margin,
            from 0; null without a posterior.
        robust: tests by the weights that are known.
        step: response to a step of the reference; null if the loop follows none.
    """

    loop: str
    period: float | None
    crossover: MarginRow
    bandwidth: MarginRow
    gain: MarginRow
    gain_reduction: MarginRow
    phase: MarginRow
    delay: MarginRow
    modulus: MarginRow
    sensitivity_peak: float
    gain_crossovers: list[CrossoverRow]
    phase_crossovers: list[CrossoverRow]
    worst_machine: int | None
    robust: list[RobustTest]
    step: StepRow | None


class AllLoopsRow(ResultRow):
    """Margins of all loops at once.

    Args:
        modulus: 1 / max sigma(S), the units of the signals scaled out.
        singular: 1 / max sigma(S) in SI units of the signals.
        robust: tests by the weights that are known.
    """

    modulus: MarginRow
    singular: MarginRow
    robust: list[RobustTest]


class VariantLoopRow(ResultRow):
    """Margins of a loop in a variant: factor, degrees, seconds and distance; null for no limit."""

    loop: str
    gain: float | None
    phase: float | None
    delay: float | None
    modulus: float | None


class VariantRow(ResultRow):
    """Stability in a test's own model or pose.

    Args:
        variant: its name.
        is_stable: whether the loops are stable.
        growing_pole: frequency [Hz] of the pole that grows; null if none does.
        unstable_machines: number of machines of the posterior that are unstable.
        loops: margins; empty if the loops are unstable.
    """

    variant: str
    is_stable: bool
    growing_pole: float | None
    unstable_machines: int
    loops: list[VariantLoopRow]


class MarginsRow(ResultRow):
    """Stability margins.

    Args:
        machines: number of machines of the posterior.
        loops: margins of each loop.
        all_loops: of all at once; null with one loop.
        variants: models and poses that tests of the campaign had.
    """

    machines: int
    loops: list[LoopMarginsRow]
    all_loops: AllLoopsRow | None
    variants: list[VariantRow]


class LimitingModeRow(ResultRow):
    """Mode that limits the gain of a loop.

    Args:
        frequency, damping: of the mode of the machine [Hz].
        gain: factor by which the gain may rise as far as this mode is concerned.
        at: frequency at which this gain is reached [Hz].
        springs, bodies: shares of the parts that hold most strain and kinetic energy.
        notch: ratio d of a notch at the mode, (s^2 + d w s + w^2) / (s^2 + w s + w^2); null where
            it would be too shallow.
        notch_phase: what it adds to the phase at the crossover [deg]; null without a notch.
        notch_crossover: largest crossover with the notch [Hz]; null if there is none.
        changes: of ``gain``, relative, with each change of the machine, the strongest first.
    """

    frequency: float
    damping: float
    gain: float
    at: float
    springs: dict[str, float]
    bodies: dict[str, float]
    notch: float | None
    notch_phase: float | None
    notch_crossover: float | None
    changes: dict[str, float]


class LoopLimitRow(ResultRow):
    """Modes that limit the gain of a loop, and what would raise it.

    Args:
        loop: its name in budget.toml.
        modulus: margin that is kept.
        gain: largest factor of the gain with this margin; null if no gain has it.
        crossover: crossover there [Hz]; null without one.
        modes: those that limit the gain, from the most severe on.
    """

    loop: str
    modulus: float
    gain: float | None
    crossover: float | None
    modes: list[LimitingModeRow]
