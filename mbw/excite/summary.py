"""Numbers and sentences of an excitation: limits, intervals, coherence, joints that slide."""

from collections.abc import Iterator, Sequence

import numpy as np

from identification.words import Signal
from mbmodel import input_unit, output_unit, read_nonlinear_joints
from mbw.excite.schema import (
    EXCITATION_JSON,
    CoherenceSummary,
    CriterionRow,
    DriveRow,
    ExcitationFile,
    LimitRow,
    ParameterForecast,
)
from tuning.assessment.parameter_confidence import ParameterConfidence
from tuning.excitation.design import Excitation
from tuning.excitation.limits import force_per_unit
from tuning.excitation.prediction import (
    MIN_FORCE_OVER_FRICTION,
    MIN_SLIDING_SHARE,
    SlidingRow,
    forecast_rows,
    predict_coherence,
    predict_confidence,
    predict_sliding,
)

_STEPPED = ("m", "rad")  # units of encoders, which count steps
_LISTED_INTERVALS = 5  # widest intervals that are printed, and what stays undetermined


def summarise(
    excitation: Excitation, remarks: Sequence[str], causes: Sequence[str] = ()
) -> ExcitationFile:
    """Return the content of excitation.json.

    Args:
        remarks: sentences on the machine and what was assumed.
        causes: effects and places for which it was designed; empty for all stiffnesses.
    """
    plan, request, machine = excitation.plan, excitation.request, excitation.model.machine
    confidence = predict_confidence(excitation)
    design, laws = excitation.design, read_nonlinear_joints(machine.source)
    sliding = predict_sliding(excitation, laws)
    return ExcitationFile(
        model=str(machine.source),
        kind=request.kind,
        band=(float(plan.freq_hz[0]), float(plan.freq_hz[-1])),
        rate=plan.rate_hz,
        period=plan.period_s,
        periods=plan.periods,
        realisations=plan.realisations,
        averages=plan.averages,
        seconds=plan.seconds,
        lines=len(plan.lines),
        drives=_list_drives(excitation),
        limits=_list_limits(excitation),
        noise={
            str(port): float(value)
            for port, value in zip(request.outputs, request.noise, strict=True)
        },
        coherence=_list_coherence(excitation),
        criterion=CriterionRow(
            name="D",
            of=list(excitation.of_interest),
            causes=list(causes),
            value=design.criterion,
            flat=design.flat,
            gap=design.gap,
        ),
        parameters=_list_parameters(confidence),
        undetermined=[row.sentence for row in confidence.unidentifiable_directions()],
        sliding=sliding,
        remarks=[
            *machine.remarks,
            *remarks,
            *plan.remarks,
            *_remark_on_strokes(sliding),
            *_remark_on_steps(excitation),
        ],
    )


def _list_drives(excitation: Excitation) -> list[DriveRow]:
    """Return the drives with the rms of their signals."""
    machine, rms = excitation.model.machine, np.sqrt(excitation.power.sum(axis=0))
    rows = []
    for drive, value in zip(excitation.request.drives, rms.tolist(), strict=True):
        force, unit = force_per_unit(machine, drive)
        rows.append(
            DriveRow(
                drive=str(drive),
                unit=input_unit(machine, drive),
                force=force,
                force_unit=unit,
                rms=value,
            )
        )
    return rows


def _list_limits(excitation: Excitation) -> list[LimitRow]:
    """Return the limits with what is reached."""
    pairs = zip(excitation.limited, excitation.peaks(), strict=True)
    return [
        LimitRow(
            drive=str(each.drive), what=each.what, reached=peak, limit=each.limit, unit=each.unit
        )
        for each, peak in pairs
    ]


def _list_coherence(excitation: Excitation) -> list[CoherenceSummary]:
    """Return the coherence of each drive and output."""
    return [
        CoherenceSummary(
            drive=str(row.drive),
            output=str(row.output),
            median=float(np.median(row.coherence)),
            lowest=float(row.coherence.min()),
        )
        for row in predict_coherence(excitation)
    ]


def _list_parameters(confidence: ParameterConfidence) -> list[ParameterForecast]:
    """Return stiffnesses and dampings with their intervals."""
    return [
        ParameterForecast(
            parameter=parameter.name,
            nominal=nominal,
            unit=parameter.unit,
            interval=(low, high),
            determined=determined,
        )
        for parameter, nominal, low, high, determined in forecast_rows(confidence)
    ]


def _remark_on_strokes(sliding: Sequence[SlidingRow]) -> list[str]:
    """Return a remark if joints slide whose friction the linear model has as a spring."""
    joints = ", ".join(row.joint for row in sliding if row.sliding)
    if not joints:
        return []
    return [
        "stroke and speed are those of the linear model, in which the friction of "
        f"{joints} is a spring: where it slides, it moves further"
    ]


def _remark_on_steps(excitation: Excitation) -> list[str]:
    """Return a remark on each encoder that moves by less than a step, which is no white noise."""
    tests, steps = excitation.campaign.tests, find_steps(excitation)
    gains = np.stack([test.estimate.frf.values[:, :, 0] for test in tests], axis=2)
    motion = np.sqrt(np.einsum("foi,fi->o", np.abs(gains) ** 2, excitation.power))
    moved = dict(zip(excitation.request.outputs, motion.tolist(), strict=True))
    return [
        f"{port} moves by {moved[port]:.3g} root mean square, less than its step of {step:.3g}: it "
        "hardly counts, and the intervals are too narrow; raise the limits, lower the band, or use "
        "a finer encoder"
        for port, step in steps.items()
        if moved[port] < step
    ]


def find_steps(excitation: Excitation) -> dict[Signal, float]:
    """Return the step of each encoder for which its noise stands [m, rad]."""
    request, machine = excitation.request, excitation.model.machine
    return {
        port: float(noise * np.sqrt(6 * excitation.plan.rate_hz))
        for port, noise in zip(request.outputs, request.noise, strict=True)
        if isinstance(port, Signal) and output_unit(machine, port, "receptance") in _STEPPED
    }


def describe_excitation(summary: ExcitationFile) -> Iterator[str]:
    """Yield the sentences that the terminal shows."""
    yield from summary.remarks
    yield describe_signal(summary)
    for limit in summary.limits:
        share = 100 * limit.reached / limit.limit
        yield (
            f"{limit.drive}: {limit.what} {limit.reached:.3g} {limit.unit}, "
            f"{share:.0f} % of its limit"
        )
    yield from describe_forecast(summary)
    determined = [row for row in summary.parameters if row.determined]
    for row in sorted(determined, key=_relative_width, reverse=True)[:_LISTED_INTERVALS]:
        low, high = row.interval
        digits = max(4, int(np.ceil(2 - np.log10(max(_relative_width(row), 1e-8)))))
        yield f"expected: {row.parameter} {low:.{digits}g} to {high:.{digits}g} {row.unit} (95 %)"
    vague = summary.undetermined
    yield from vague[:_LISTED_INTERVALS]
    if len(vague) > _LISTED_INTERVALS:
        yield f"{len(vague) - _LISTED_INTERVALS} further ones stand in {EXCITATION_JSON}"
    yield from map(describe_sliding, summary.sliding)


def describe_signal(summary: ExcitationFile) -> str:
    """Return kind, drives, lines and length of the signal."""
    names = ", ".join(row.drive for row in summary.drives)
    low, high = summary.band
    return (
        f"{summary.kind} for {names}: {summary.lines} lines from {low:.4g} to {high:.4g} Hz; "
        f"{summary.realisations} x {summary.periods} periods of {summary.period:.4g} s, "
        f"{summary.seconds:.4g} s at {summary.rate:.6g} Hz"
    )


def describe_forecast(summary: ExcitationFile) -> Iterator[str]:
    """Yield for what the signal was designed, and how much it will determine."""
    criterion = summary.criterion
    shrink = np.exp((criterion.flat - criterion.value) / (2 * len(criterion.of)))
    yield (
        f"designed for {describe_aim(criterion)} (D-optimal): intervals are {shrink:.2g} times "
        "those of a flat spectrum under the same limits (geometric mean)"
    )
    determined = sum(row.determined for row in summary.parameters)
    yield f"{determined} of {len(summary.parameters)} stiffnesses and dampings will be determined"


def describe_aim(criterion: CriterionRow) -> str:
    """Return for what an excitation was designed."""
    if criterion.causes:
        return f"the open causes {', '.join(criterion.causes)}"
    return f"all {len(criterion.of)} stiffnesses"


def _relative_width(row: ParameterForecast) -> float:
    """Return the width of an interval over the nominal value; it is last without one."""
    low, high = row.interval
    return (high - low) / abs(row.nominal) if row.nominal else 0.0


def describe_sliding(row: SlidingRow) -> str:
    """Return the sentence on a joint with friction."""
    if row.sliding is not None:
        seen = f"slides {100 * row.sliding:.0f} % of the time"
        least = f"{100 * MIN_SLIDING_SHARE:.0f} %"
    else:
        seen = f"feels up to {row.force_ratio:.3g} times its friction"
        least = f"{MIN_FORCE_OVER_FRICTION:.3g} times"
    if row.slides:
        return f"joint {row.joint} {seen}: it slides all the time"
    return (
        f"joint {row.joint} {seen}, less than {least}: where it sticks its friction is stiffness; "
        "raise the limits, or lower the band"
    )
