"""Stability margins as rows of JSON."""

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np

from identification.words import Real
from mbw.plant.margin_schema import (
    AllLoopsRow,
    CrossoverRow,
    LimitingModeRow,
    LoopLimitRow,
    LoopMarginsRow,
    MarginRow,
    MarginsRow,
    StepRow,
    VariantLoopRow,
    VariantRow,
)
from tuning import NORMAL_QUANTILE_95
from tuning.files.parameter_rows import finite_or_none
from tuning.plant.control_loops.stability_margins import AllMargins, Margin
from tuning.plant.error_budget.loop_margins import PlantMargins, VariantMargins
from tuning.plant.error_budget.margin_design import LimitingMode, LoopDesign

_ENDS = (0.025, 0.975)
_VARIANT_MARGINS = ("gain", "phase", "delay", "modulus")
MarginName = Literal["crossover", "bandwidth", "gain", "reduction", "phase", "delay", "modulus"]


def margins_row(
    margins: PlantMargins,
    variants: Sequence[VariantMargins] = (),
    before: AllMargins | None = None,
) -> MarginsRow:
    """Return the rows of the margins of a budget.

    Args:
        margins: of the machine.
        variants: stability in models and poses that tests had.
        before: of the other machine; None without one.
    """
    several = len(margins.names) > 1
    return MarginsRow(
        machines=len(margins.samples),
        loops=[_loop_row(margins, number, before) for number in range(len(margins.names))],
        all_loops=_all_loops_row(margins, before) if several else None,
        variants=[_variant_row(margins.names, each) for each in variants],
    )


def _loop_row(margins: PlantMargins, number: int, before: AllMargins | None) -> LoopMarginsRow:
    """Return the row of one loop."""
    loop, step = margins.nominal.loops[number], margins.steps[number]
    samples = [each.loops[number] for each in margins.samples]

    def row(name: MarginName) -> MarginRow:
        sign = -1.0 if name == "reduction" else 1.0
        margin = _margin_row(
            getattr(loop, name), [getattr(sample, name) for sample in samples], sign
        )
        if margins.by_floor:
            deviation = margins.by_floor[number].get(name, 0.0)
            margin = _widen(margin, deviation, is_logarithm=name != "phase")
        return _beside(margin, None if before is None else getattr(before.loops[number], name))

    return LoopMarginsRow(
        loop=margins.names[number],
        period=margins.period_s or None,
        crossover=row("crossover"),
        bandwidth=row("bandwidth"),
        gain=row("gain"),
        gain_reduction=row("reduction"),
        phase=row("phase"),
        delay=row("delay"),
        modulus=row("modulus"),
        sensitivity_peak=1 / loop.modulus.value,
        gain_crossovers=_crossover_rows(loop.gain_crossovers),
        phase_crossovers=_crossover_rows(loop.phase_crossovers),
        worst_machine=margins.worst_sample(number) if samples else None,
        robust=list(margins.robust[number]),
        step=None if step is None else StepRow.model_validate(step),
    )


def _all_loops_row(margins: PlantMargins, before: AllMargins | None) -> AllLoopsRow:
    """Return the row of all loops at once."""

    def row(pick: Callable[[AllMargins], Margin]) -> MarginRow:
        margin = _margin_row(pick(margins.nominal), [pick(each) for each in margins.samples])
        return _beside(margin, None if before is None else pick(before))

    return AllLoopsRow(
        modulus=row(lambda each: each.modulus),
        singular=row(lambda each: each.singular),
        robust=list(margins.robust_at_once),
    )


def _widen(row: MarginRow, deviation: float, *, is_logarithm: bool) -> MarginRow:
    """Return a margin whose interval has the model-error floor too, in quadrature.

    Args:
        row: with the interval over machines of the posterior.
        deviation: standard deviation by the floor.
        is_logarithm: whether it is that of the logarithm.
    """
    value = row.value
    if value is None or not deviation:
        return row

    def end(limit: float | None, sign: float) -> float | None:
        if limit is None:
            return None
        reach = NORMAL_QUANTILE_95 * deviation
        if is_logarithm:
            return value * float(np.exp(sign * np.hypot(np.log(limit / value), reach)))
        return value + sign * float(np.hypot(limit - value, reach))

    floor = value * deviation if is_logarithm else deviation
    return row.model_copy(
        update={"low": end(row.low, -1.0), "high": end(row.high, 1.0), "floor": floor}
    )


def _beside(row: MarginRow, before: Margin | None) -> MarginRow:
    """Return a row with the margin of the other machine."""
    return row if before is None else row.model_copy(update={"before": before.stated})


def _margin_row(nominal: Margin, samples: Sequence[Margin], sign: float = 1.0) -> MarginRow:
    """Return a margin with its interval and its worst value.

    Args:
        nominal: of the machine.
        samples: of machines of the posterior.
        sign: -1 where a large value is bad.
    """
    low = high = worst = None
    if any(sample.is_finite for sample in samples):
        values = np.array([sample.value for sample in samples])
        # "lower" and "higher" never interpolate between infinite values.
        ends = (
            np.quantile(values, _ENDS[0], method="lower"),
            np.quantile(values, _ENDS[1], method="higher"),
        )
        limits = [*ends, values[np.argmin(sign * np.abs(values))]]
        # A gain reduction of 0 is none: the loop may be opened.
        low, high, worst = (
            float(limit) if np.isfinite(limit) and (sign > 0 or limit > 0) else None
            for limit in limits
        )
    return MarginRow(
        value=nominal.stated,
        frequency=nominal.freq_hz if nominal.is_finite else None,
        low=low,
        high=high,
        worst=worst,
    )


def _variant_row(names: tuple[str, ...], variant: VariantMargins) -> VariantRow:
    """Return the row of one variant."""
    loops = () if variant.margins is None else variant.margins.loops
    pole = variant.pole
    return VariantRow(
        variant=variant.variant,
        is_stable=pole is None,
        growing_pole=None if pole is None else abs(pole.imag) / (2 * np.pi),
        unstable_machines=variant.unstable_samples,
        loops=[
            VariantLoopRow(loop=name, **loop.state(_VARIANT_MARGINS))
            for name, loop in zip(names, loops, strict=False)
        ],
    )


def _crossover_rows(crossovers: Real) -> list[CrossoverRow]:
    """Return crossovers with their margins."""
    return [CrossoverRow(frequency=float(f), margin=float(m)) for f, m in crossovers]


def limit_rows(designs: Sequence[LoopDesign]) -> list[LoopLimitRow]:
    """Return what limits the gain of each loop."""
    return [
        LoopLimitRow(
            loop=design.loop,
            modulus=design.modulus,
            gain=finite_or_none(design.gain),
            crossover=finite_or_none(design.crossover_hz),
            modes=[_mode_row(mode) for mode in design.modes],
        )
        for design in designs
    ]


def _mode_row(mode: LimitingMode) -> LimitingModeRow:
    """Return the row of a mode that limits a loop."""
    has_notch = mode.notch is not None
    return LimitingModeRow(
        frequency=mode.freq_hz,
        damping=mode.damping,
        gain=mode.gain,
        at=mode.at_hz,
        springs=mode.springs,
        bodies=mode.bodies,
        notch=mode.notch,
        notch_phase=mode.notch_phase_deg if has_notch else None,
        notch_crossover=finite_or_none(mode.notch_crossover_hz) if has_notch else None,
        changes=mode.changes,
    )
