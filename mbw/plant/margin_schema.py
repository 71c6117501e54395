"""Rows of stability margins in the JSON file of ``mbw predict``."""

from typing import Annotated

from pydantic import BaseModel, Field

Number = Annotated[float, Field(allow_inf_nan=False)]


class MarginRow(BaseModel):
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

    value: Number | None
    frequency: Number | None
    low: Number | None
    high: Number | None
    worst: Number | None
    before: Number | None = None
    floor: Number | None = None


class RobustTestRow(BaseModel):
    """Robust stability by |W T| < 1.

    Args:
        weight: what W is.
        peak: largest |W T|.
        frequency: of the peak [Hz].
        band: in which W is known [Hz].
        holds: whether the peak is below 1.
        outside: frequencies outside the band with |L| = 1 or at a peak of |T| [Hz].
        robustly_stable: whether the loops are stable for all plants within W; null where the peak
            is below 1 but W is not known at all frequencies that matter.
        wanted_band: that a test has to cover, so that W is known there [Hz].
    """

    weight: str
    peak: Number
    frequency: Number
    band: tuple[Number, Number]
    holds: bool
    outside: list[Number]
    robustly_stable: bool | None
    wanted_band: tuple[Number, Number]


class CrossoverRow(BaseModel):
    """A crossover: its frequency [Hz] and the margin there [deg, or factor]."""

    frequency: Number
    margin: Number


class StepRow(BaseModel):
    """Response to a unit step of the reference.

    Args:
        final: value at the end of all time.
        overshoot: largest value above the final one, relative to it.
        rise_time: from 10 to 90 % [s]; null if not reached in 200 periods of the crossover.
        settling_time: until it stays within 2 % [s]; null likewise.
    """

    final: Number
    overshoot: Number
    rise_time: Number | None
    settling_time: Number | None


class LoopMarginsRow(BaseModel):
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
    period: Number | None
    crossover: MarginRow
    bandwidth: MarginRow
    gain: MarginRow
    gain_reduction: MarginRow
    phase: MarginRow
    delay: MarginRow
    modulus: MarginRow
    sensitivity_peak: Number
    gain_crossovers: list[CrossoverRow]
    phase_crossovers: list[CrossoverRow]
    worst_machine: int | None
    robust: list[RobustTestRow]
    step: StepRow | None


class AllLoopsRow(BaseModel):
    """Margins of all loops at once.

    Args:
        modulus: 1 / max sigma(S), the units of the signals scaled out.
        singular: 1 / max sigma(S) in SI units of the signals.
        robust: tests by the weights that are known.
    """

    modulus: MarginRow
    singular: MarginRow
    robust: list[RobustTestRow]


class VariantLoopRow(BaseModel):
    """Margins of a loop in a variant: factor, degrees, seconds and distance; null for no limit."""

    loop: str
    gain: Number | None
    phase: Number | None
    delay: Number | None
    modulus: Number | None


class VariantRow(BaseModel):
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
    growing_pole: Number | None
    unstable_machines: int
    loops: list[VariantLoopRow]


class MarginsRow(BaseModel):
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
