"""An error budget as rows of JSON."""

from collections.abc import Sequence

import numpy as np

from identification.words import Complex, Real
from mbw.plant.margin_rows import limit_rows, margins_row
from mbw.plant.schema import (
    BudgetRow,
    ErrorRow,
    PoleRow,
    ShareOfErrorRow,
    ShareOfPoleRow,
)
from tuning.plant.error_budget.budget import ErrorBudget
from tuning.plant.error_budget.margin_design import LoopDesign
from tuning.plant.error_budget.plant_budget import PlantBudget

_MAX_LISTED_SHARES = 12  # modes, joints and springs of an error
_MAX_CUMULATIVE_LINES = 600
_MAX_POLE_AT_REST = 1e-9  # size of a pole over the largest: what rounding leaves of motions at rest


def budget_row(
    plant: PlantBudget,
    file: str,
    before: str | None,
    remarks: list[str],
    designs: Sequence[LoopDesign],
) -> BudgetRow:
    """Return the rows of a budget.

    Args:
        before: the other machine; None without one.
        designs: what limits each loop.
    """
    budget = plant.budget
    definition = budget.definition
    return BudgetRow(
        file=file,
        before=before,
        band=definition.band,
        loops=[loop.name for loop in definition.loops],
        lines=budget.random_lines,
        remarks=remarks,
        errors=[_error_row(plant, number) for number in range(len(definition.errors))],
        poles=pole_rows(budget),
        margins=None
        if plant.margins is None
        else margins_row(plant.margins, plant.variant_margins, plant.margins_before),
        limits=limit_rows(designs),
    )


def _error_row(plant: PlantBudget, number: int) -> ErrorRow:
    """Return the row of one error."""
    budget, interval = plant.budget, plant.interval
    error = budget.definition.errors[number]
    ends = None if interval is None else interval.ends()
    freq, cumulative = thin_cumulative(budget, number)
    names, joints = budget.joint_shares
    poles, modes = budget.mode_shares
    order = np.argsort(-np.abs(modes[number, :-1]), kind="stable")[:_MAX_LISTED_SHARES]
    return ErrorRow(
        name=error.name,
        signal=str(error),
        unit=budget.definition.units[error.name][0],
        rms=float(budget.rms[number]),
        low=None if ends is None else float(ends[0][number]),
        high=None if ends is None else float(ends[1][number]),
        deviation=None if interval is None else float(interval.deviation[number]),
        before=None if plant.before is None else float(plant.before.rms[number]),
        sources=[
            ShareOfErrorRow(name=source.name, share=float(share))
            for source, share in zip(
                budget.definition.sources, budget.source_shares[number], strict=True
            )
        ],
        cross_terms=[
            ShareOfErrorRow(name=f"{first} and {second}", share=float(shares[number]))
            for first, second, shares in budget.cross_shares()
        ],
        modes=[_mode_share(complex(poles[k]), float(modes[number, k])) for k in order],
        modes_rest=float(modes[number, -1]),
        joints=_largest(names, joints[number]),
        touches=list(plant.touches[number][:_MAX_LISTED_SHARES]),
        freq_hz=freq.tolist(),
        cumulative=cumulative.tolist(),
    )


def _mode_share(pole: complex, share: float) -> ShareOfPoleRow:
    """Return the share of a mode."""
    size = abs(pole)
    damping = -pole.real / size if size else 0.0
    return ShareOfPoleRow(frequency=size / (2 * np.pi), damping=damping, share=share)


def _largest(names: tuple[str, ...], shares: Real) -> list[ShareOfErrorRow]:
    """Return the largest shares, by their size."""
    order = np.argsort(-np.abs(shares), kind="stable")[:_MAX_LISTED_SHARES]
    return [ShareOfErrorRow(name=names[k], share=float(shares[k])) for k in order]


def pole_rows(budget: ErrorBudget) -> list[PoleRow]:
    """Return the poles with the loops up to twice the band; of a pair that of positive frequency.

    A real pole has the damping ratio 1, or -1 if it grows; those at rest are left out.
    """
    poles: Complex = budget.states.poles()
    highest = 4 * np.pi * budget.definition.band[1]
    size = np.abs(poles)
    lowest = _MAX_POLE_AT_REST * size.max(initial=0.0)
    chosen = sorted(poles[(poles.imag >= 0) & (size > lowest) & (size < highest)], key=abs)
    return [
        PoleRow(
            frequency=float(abs(pole) / (2 * np.pi)),
            damping=float(-pole.real / abs(pole)),
            real=float(pole.real),
            imaginary=float(pole.imag),
        )
        for pole in chosen
    ]


def thin_cumulative(budget: ErrorBudget, number: int) -> tuple[Real, Real]:
    """Return a cumulative spectrum at up to 600 lines: where it changes most."""
    freq, values = budget.cumulative()
    values = values[:, number]
    if len(freq) <= _MAX_CUMULATIVE_LINES:
        return freq, values
    # Equal steps of the way along both axes keep flat parts and steps alike.
    log_freq = np.log(freq)
    total = max(float(values[0]), np.finfo(float).tiny)
    way = np.abs(np.diff(log_freq)) / (log_freq[-1] - log_freq[0]) + np.abs(np.diff(values)) / total
    along = np.append(0.0, np.cumsum(way))
    at = np.linspace(0.0, along[-1], _MAX_CUMULATIVE_LINES)
    chosen = np.unique(np.minimum(np.searchsorted(along, at), len(freq) - 1))
    return freq[chosen], values[chosen]
