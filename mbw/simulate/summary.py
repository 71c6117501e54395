"""Summary of a simulation for ``--json`` and the terminal."""

import math
from typing import Any

import numpy as np
from pydantic import Field

from identification.readers.result_files import ResultFile, ResultRow
from mbmodel import TimeStep
from mbmodel.simulation.loop_signals import LoopRecord
from mbw.page.numbers import format_percent
from tuning.plant.error_budget.simulated_budget import SimulatedErrors


class SimulatedErrorRow(ResultRow):
    """An error of the budget in time.

    Args:
        error: its name.
        rms: over the time [SI].
        predicted: by the budget of the linear machine [SI]; null without one.
        scatter: standard deviation of the simulated rms over the predicted one.
    """

    error: str
    rms: float
    predicted: float | None
    scatter: float | None


class SimulatedLoopRow(ResultRow):
    """A loop in time.

    Args:
        loop: its name.
        rms, largest: tracking error, in the unit of what it measures.
        settling: time from the end of the last move until the error stays in the window [s]; null
            without a move, or if it does not.
        control: largest magnitude of the machine's input.
        limit: of the input; null without one.
        limited: share of the time at the limit.
    """

    loop: str
    rms: float
    largest: float
    settling: float | None
    control: float
    limit: float | None
    limited: float


class SimulationSummary(ResultFile):
    """Summary of ``mbw simulate``.

    Args:
        model: path of the MJCF.
        kind: ``hammer test`` or ``signal``.
        integrator: ``RK4``, ``implicitfast`` or ``discrete``.
        step: of the integration [s].
        error: estimated error of the channels, relative to their rms; null if an estimate failed.
        span: time over which it was estimated [s].
        files: files that were written.
        hits: number of hits of a hammer test; null for a signal.
        rate: samples per second of records and responses [Hz].
        duration: of one record [s].
        seconds: of simulated time.
        errors: of the budget.
        loops: that are closed.
    """

    model: str
    kind: str
    integrator: str
    step: float
    error: float | None
    span: float
    files: list[str]
    hits: int | None
    rate: float
    duration: float
    seconds: float
    errors: list[SimulatedErrorRow] = Field(default_factory=list)
    loops: list[SimulatedLoopRow] = Field(default_factory=list)


def error_rows(simulated: SimulatedErrors) -> list[SimulatedErrorRow]:
    """Return the rows of the errors of a budget."""
    count = len(simulated.definition.errors)
    expected = [None] * count if simulated.predicted is None else simulated.predicted.tolist()
    scatter = [None] * count if simulated.scatter is None else simulated.scatter.tolist()
    names = [error.name for error in simulated.definition.errors]
    columns = zip(names, simulated.rms.tolist(), expected, scatter, strict=True)
    return [
        SimulatedErrorRow(error=name, rms=rms, predicted=value, scatter=width)
        for name, rms, value, width in columns
    ]


def loop_row(record: LoopRecord, window: float | None) -> SimulatedLoopRow:
    """Return the row of a loop.

    Args:
        window: tracking error within which a move has settled; None for 2 % of it.
    """
    return SimulatedLoopRow(
        loop=record.loop.name,
        rms=float(np.sqrt(np.mean(record.error**2))),
        largest=float(np.abs(record.error).max()),
        settling=record.settling_time_s(window),
        control=float(np.abs(record.control).max()),
        limit=record.loop.limit,
        limited=record.limited_share,
    )


def error_sentences(simulated: SimulatedErrors, duration_s: float) -> list[str]:
    """Return a sentence for each error of a budget."""
    sentences = []
    for row in error_rows(simulated):
        unit, size = simulated.definition.units[row.error]
        text = f"{row.error}: {row.rms / size:.4g} {unit} rms over {duration_s:.4g} s"
        if row.predicted is not None and row.scatter is not None:
            text += (
                f"; the budget of the linear machine predicts {row.predicted / size:.4g} {unit}, "
                f"with a scatter of {100 * row.scatter:.2g} % over this time"
            )
        sentences.append(f"{text}.")
    return sentences


def loop_sentences(record: LoopRecord, window: float | None) -> list[str]:
    """Return sentences on tracking, settling and control of a loop."""
    row, loop = loop_row(record, window), record.loop
    unit, moved = loop.measured.unit, np.ptp(record.reference) > 0
    within = "2 % of the move" if window is None else f"{window:g} {unit}"
    text = f"loop {row.loop}: error {row.rms:.4g} {unit} rms, {row.largest:.4g} {unit} at most"
    if moved and row.settling is None:
        text += f"; it does not settle within {within}"
    elif row.settling is not None:
        text += f"; within {within} from {row.settling:.4g} s after the end of the move on"
    kind = "" if loop.input_unit == "control" else f" {loop.input_unit}"
    text += f"; the control is at most {row.control:.4g}{kind}"
    if row.limit is not None and row.limited:
        share = format_percent(row.limited, 2)
        text += f" and at its limit of {row.limit:g} for {share} of the time"
    return [f"{text}."]


def step_sentence(step: TimeStep) -> str:
    """Return integrator, step and estimated error in words."""
    error = f"{step.error:.1g}" if math.isfinite(step.error) else "unknown"
    return (
        f"Integrator {step.integrator}, step {1e6 * step.step_s:.4g} us; estimated error {error} "
        f"of the channels' rms (against half the step, over {step.span_s:.2g} s)."
    )


def step_fields(step: TimeStep) -> dict[str, Any]:
    """Return the fields of a summary that describe the integration."""
    error = step.error if np.isfinite(step.error) else None
    return {"integrator": step.integrator, "step": step.step_s, "error": error, "span": step.span_s}
