"""Check of the measurement against the nominal model: wrong units, quantity, frequency axis.

Level curves of both are compared (``tuning.checks.level_curves``). A small shift along ln w stands
for wrong stiffness, which is ordinary. For each possible fault of the export, the loss is

    min over shifts of the median over bins of |measured - nominal - what the fault adds|

On random machines with stiffness off by up to 3, masses by 20 % and a missing effect, the loss
without a fault is at most 0.6 (a factor of 1.9). A loss far above, which one fault removes, is that
fault. For frequency axes the correlation of the curves without their trends must agree too.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from identification.words import (
    MAX_FREQUENCY_HZ,
    MIN_FREQUENCY_HZ,
    Campaign,
    Quantity,
    Real,
    Signal,
    Test,
)
from mbmodel import Model, output_unit
from tuning.checks.export_faults import DECIBELS, ExportFault, StatedExport, list_faults
from tuning.checks.export_finding import ExportFinding
from tuning.checks.level_curves import (
    LevelCurve,
    level_curve,
    predict_on_lines,
    split_by_scale,
    strong_cells,
)

_Scale = tuple[str, str, str]  # file, encoder and motor


@dataclass(frozen=True)
class _ExportLimits:
    """Constants of the comparison; losses and levels are natural logarithms of a factor."""

    # ln of frequency: stiffness off by up to a factor of 3.3.
    max_shift: float = 0.6
    shift_step: float = 0.05
    # Losses of right data reach 0.6; a factor of 2.7 beyond the nominal model's scatter is none.
    max_explained_loss: float = 0.6
    min_refused_loss: float = 1.0
    min_remark_loss: float = 0.8
    min_loss_gain: float = 0.69  # a factor of 2 in level, by which a fault must improve
    # A wrong frequency unit hardly changes levels where the curves are flat. Its evidence is the ln
    # of the ratio of losses plus twice the rise of the correlation: mostly below -0.4 for right
    # files, and above 0.5 for every wrong one whose nominal model is right.
    min_refused_axis_evidence: float = 0.7
    min_remark_axis_evidence: float = 0.4
    correlation_weight: float = 2.0
    min_axis_log_span: float = 1.2  # ln of the last over the first frequency, for this evidence
    min_loss: float = 0.02  # a smaller loss is as good as none
    max_tie: float = 0.35  # losses within this of the best: faults that cannot be told apart
    nominal_step: float = 0.01  # of ln f, between the nominal model's lines
    # Around few modes the level depends on which mode lies there: a stiffness off by 5 puts another
    # one in the band. There a unit is certain only where no mode makes the difference.
    min_refused_log_span: float = 0.69  # ln of the last over the first frequency: an octave
    min_refused_narrow_loss: float = 3.0  # a factor of 20
    min_refused_single_loss: float = 5.3  # a factor of 200, in one FRF of a column of several
    # A factor of 1.6 in level, without a known reason: where a common factor removes most of the
    # difference, masses off by 20 % and stiffness off by 3 leave an offset of at most 0.2.
    min_remark_offset: float = 0.47
    min_factor_loss: float = 0.45  # with shifts alone: stiffness off by 3 explains less
    max_scatter_share: float = 0.5  # of the offset, that may remain once it is removed
    # Decibels: their true magnitudes left 0.45 to 0.78 of the scatter of the decibels on random
    # machines, and had correlations of 0.57 and more. FRFs are far from 1 somewhere: decibels are
    # no small numbers.
    max_decibel_scatter_ratio: float = 0.85
    min_decibel_correlation: float = 0.5
    min_median_decibels: float = 5.0
    decibel: float = float(np.log(10) / 20)  # ln of a magnitude per decibel
    min_bins: int = 12
    max_cell_lines: int = 400  # on which the model tells strong channels by their medians


_EXPORT_LIMITS = _ExportLimits()


def compare_with_model(
    model: Model, campaign: Campaign, stated: dict[str, StatedExport]
) -> list[ExportFinding]:
    """Compare each file's FRFs with the nominal model's, before any fit.

    Args:
        model: nominal model.
        campaign: tests in the band.
        stated: how each file was read, by its name.

    Returns:
        One finding for each file, and each encoder and motor, that differs by more than wrong
        stiffness explains.
    """
    findings = {
        scale: _compare_file(model, tests, stated[scale[0]])
        for scale, tests in split_by_scale(campaign).items()
        if scale[0] in stated
    }
    rows = []
    for (file, encoder, drive), finding in findings.items():
        clause = _name_columns(stated[file], encoder, drive)
        if finding is not None:
            is_certain = finding.is_certain
            if clause:
                is_certain &= finding.is_level and _is_shown_by_column(
                    findings, (file, encoder, drive)
                )
            table = "under [log]" if stated[file].columns else finding.table
            rows.append(replace(finding, columns=clause, table=table, is_certain=is_certain))
    return rows


def _is_shown_by_column(findings: Mapping[_Scale, ExportFinding | None], scale: _Scale) -> bool:
    """Return whether all FRFs of an encoder, or all of a motor, show a fault of their column.

    Of columns a unit alone is certain: a motor in counts may look like another quantity. Its factor
    is in every FRF of the column. In a single one of them it may be that of a way across the
    machine that the drawing hardly has: on random machines up to 55.
    """
    finding, of_file = findings[scale], [each for each in findings if each[0] == scale[0]]
    if finding is None:
        return False
    if len(of_file) == 1 or abs(np.log(finding.factor)) >= _EXPORT_LIMITS.min_refused_single_loss:
        return True
    for column in (1, 2):
        alike = [findings[each] for each in of_file if each[column] == scale[column]]
        shared = [each for each in alike if each and {*each.faults} & {*finding.faults}]
        if len(shared) == len(alike) > 1:
            return True
    return False


def _name_columns(stated: StatedExport, encoder: str, drive: str) -> str:
    """Return a clause on the encoder and the motor of FRFs, with their columns in a log."""
    names = [
        f"{name} (column {stated.columns[name]!r})" if name in stated.columns else name
        for name in (encoder, drive)
        if name
    ]
    return f", {' over '.join(names)}" if names else ""


def _encoder_kind(model: Model, campaign: Campaign) -> Literal["", "m", "rad"]:
    """Return the unit of what an encoder reads; empty where the channels are no encoder."""
    output = campaign.tests[0].estimate.frf.outputs[0]
    if not isinstance(output, Signal):
        return ""
    return "rad" if output_unit(model.machine, output, "receptance").startswith("rad") else "m"


@dataclass(frozen=True)
class _CurveAgreement:
    """Agreement of the curves under one fault.

    Args:
        loss: median absolute difference at the best shift.
        correlation: largest correlation over shifts, without linear trends.
        offset: median difference at the best shift.
        scatter: smallest median absolute difference over shifts once its median is removed.
        factor: that median.
        log_span: ln of the last over the first measured frequency.
    """

    loss: float
    correlation: float
    offset: float
    log_span: float
    scatter: float = 0.0
    factor: float = 0.0


def _compare_file(model: Model, campaign: Campaign, stated: StatedExport) -> ExportFinding | None:
    """Compare one file with the nominal model; None if it may be right."""
    faults = list_faults(stated, _encoder_kind(model, campaign))
    axes = dict.fromkeys([1.0, *(fault.axis for fault in faults)])
    curves = {axis: _curves(model, campaign, axis) for axis in axes}
    if curves[1.0] is None:
        return None
    null = _agreement(*curves[1.0], ExportFault("", ""), stated.quantity)
    if null is None:
        return None
    has_gross_loss = null.loss >= _EXPORT_LIMITS.min_refused_loss
    rows = []
    for fault in faults:
        pair = curves[fault.axis]
        if fault.parameters:
            pair = _curves(model, campaign, 1.0, fault) if has_gross_loss else None
        agreement = _agreement(*pair, fault, stated.quantity) if pair is not None else None
        if agreement is not None and agreement.loss <= _EXPORT_LIMITS.max_explained_loss:
            rows.append((fault, agreement))
    certain = [row for row in rows if _is_certain(row[0], null, row[1])]
    if has_gross_loss and _holds_decibels(model, campaign, null):
        file = campaign.tests[0].condition.test
        return ExportFinding(file, float(np.exp(null.offset)), (DECIBELS,), is_certain=True)
    has_factor = _has_unknown_factor(null)
    likely = certain or [row for row in rows if _is_likely(*row, null, has_factor=has_factor)]
    if not likely and not has_factor:
        return None
    closest = _closest_faults(likely)
    level = closest[0][0].log_factor + closest[0][1].offset if closest else null.factor
    named = tuple(fault for fault, _ in closest)
    file = campaign.tests[0].condition.test
    return ExportFinding(file, float(np.exp(level)), named, bool(certain))


def _has_unknown_factor(null: _CurveAgreement) -> bool:
    """Return whether one factor without a known reason lies between the curves."""
    limits = _EXPORT_LIMITS
    if null.loss >= limits.min_remark_loss and abs(null.offset) >= np.log(2):
        return True
    return (
        null.log_span >= limits.min_refused_log_span
        and null.loss >= limits.min_factor_loss
        and abs(null.factor) >= limits.min_remark_offset
        and null.scatter <= limits.max_scatter_share * abs(null.factor)
    )


def _holds_decibels(model: Model, campaign: Campaign, null: _CurveAgreement) -> bool:
    """Return whether values taken as decibels fit the model, and as they are do not.

    The decibels may be negative, or refer to a small unit: any factor is allowed. Wrong units, the
    rivals, leave correlation and scatter of the curves as they are.
    """
    limits = _EXPORT_LIMITS
    sizes = [np.median(np.abs(test.estimate.frf.values)) for test in campaign.tests]
    if np.median(sizes) < limits.min_median_decibels:
        return False
    max_scatter = min(limits.max_explained_loss, limits.max_decibel_scatter_ratio * null.scatter)
    for sign in (1.0, -1.0):
        pair = _curves(model, _from_decibels(campaign, sign), 1.0)
        linear = None if pair is None else _agreement(*pair, ExportFault("", ""), "accelerance")
        if linear is not None and (
            linear.scatter <= max_scatter and linear.correlation >= limits.min_decibel_correlation
        ):
            return True
    return False


def _from_decibels(campaign: Campaign, sign: float) -> Campaign:
    """Return the campaign with magnitudes of decibels, without noise; ``sign`` is theirs."""

    def convert(test: Test) -> Test:
        estimate = test.estimate
        log = np.clip(sign * _EXPORT_LIMITS.decibel * np.abs(estimate.frf.values), -25.0, 25.0)
        frf = replace(estimate.frf, values=np.exp(log) + 0j)
        variance = np.zeros_like(estimate.variance)
        return replace(test, hits=None, estimate=replace(estimate, frf=frf, variance=variance))

    return replace(campaign, tests=tuple(convert(test) for test in campaign.tests))


def _closest_faults(
    rows: list[tuple[ExportFault, _CurveAgreement]],
) -> list[tuple[ExportFault, _CurveAgreement]]:
    """Return the faults whose losses cannot be told from the smallest, in their order.

    A rare fault is named only where no usual one explains the file.
    """
    best = min((agreement.loss for _, agreement in rows), default=0.0)
    close = [row for row in rows if row[1].loss <= best + _EXPORT_LIMITS.max_tie]
    usual = [row for row in close if not row[0].is_rare]
    return sorted(usual or close, key=lambda row: row[1].loss)


def _is_certain(fault: ExportFault, null: _CurveAgreement, agreement: _CurveAgreement) -> bool:
    """Return whether a fault explains the file, and the file cannot be right without it."""
    gain = null.loss - agreement.loss
    if null.loss >= _EXPORT_LIMITS.min_refused_loss and gain >= _EXPORT_LIMITS.min_loss_gain:
        is_wide = null.log_span >= _EXPORT_LIMITS.min_refused_log_span
        return is_wide or null.loss >= _EXPORT_LIMITS.min_refused_narrow_loss
    return _axis_evidence(fault, agreement, null) > _EXPORT_LIMITS.min_refused_axis_evidence


def _is_likely(
    fault: ExportFault, agreement: _CurveAgreement, null: _CurveAgreement, *, has_factor: bool
) -> bool:
    """Return whether a fault deserves a remark.

    Args:
        has_factor: whether a factor between the curves is remarked in any case.
    """
    is_gross = has_factor or null.loss >= _EXPORT_LIMITS.min_refused_loss
    if is_gross and null.loss - agreement.loss >= _EXPORT_LIMITS.min_loss_gain:
        return True
    return _axis_evidence(fault, agreement, null) > _EXPORT_LIMITS.min_remark_axis_evidence


def _axis_evidence(fault: ExportFault, agreement: _CurveAgreement, null: _CurveAgreement) -> float:
    """Return the evidence for a wrong frequency unit; minus infinity for another fault.

    A narrow band shows too little of the curve. Where the
    axis would be too small, the nominal model is on its mass line, which many curves resemble.
    """
    if fault.axis <= 1.0 or fault.is_elsewhere or null.log_span < _EXPORT_LIMITS.min_axis_log_span:
        return -np.inf
    losses = np.maximum([null.loss, agreement.loss], _EXPORT_LIMITS.min_loss)
    rise = agreement.correlation - null.correlation
    return float(np.log(losses[0] / losses[1]) + _EXPORT_LIMITS.correlation_weight * rise)


def _curves(
    model: Model, campaign: Campaign, axis: float, fault: ExportFault | None = None
) -> tuple[LevelCurve, LevelCurve] | None:
    """Return the measured curve and the nominal one at the frequencies over ``axis``.

    The parameters of the nominal model that the fault names are corrected.
    """
    theta = model.drawn
    if fault is not None:
        is_wrong = [any(part in p.name for part in fault.parameters) for p in model.parameters]
        theta = np.where(is_wrong, fault.parameter_factor, 1.0) * theta
    freq = campaign.freq_hz[campaign.freq_hz > 0]
    if len(freq) < _EXPORT_LIMITS.min_bins:
        return None
    low, high = np.log(freq[[0, -1]] / axis)
    span = _EXPORT_LIMITS.max_shift + 2 * _EXPORT_LIMITS.nominal_step
    if low - span < np.log(MIN_FREQUENCY_HZ) or high + span > np.log(MAX_FREQUENCY_HZ):
        return None  # no machine has such frequencies
    few = freq[:: 1 + len(freq) // _EXPORT_LIMITS.max_cell_lines]
    near = predict_on_lines(model, campaign, few / axis, theta)
    cells = tuple(a & b for a, b in zip(strong_cells(campaign), strong_cells(near), strict=True))
    grid = np.exp(np.arange(low - span, high + span, _EXPORT_LIMITS.nominal_step))
    measured = level_curve(campaign, cells)
    nominal = level_curve(predict_on_lines(model, campaign, grid, theta), cells)
    return None if measured is None or nominal is None else (measured, nominal)


def _agreement(
    measured: LevelCurve, nominal: LevelCurve, fault: ExportFault, quantity: Quantity
) -> _CurveAgreement | None:
    """Return how well the curves agree under a fault, at the best shifts."""
    expected = measured.level - fault.level_change(measured.log_freq, quantity)
    true_log_freq = measured.log_freq - np.log(fault.axis)
    shifts = np.arange(
        -_EXPORT_LIMITS.max_shift, _EXPORT_LIMITS.max_shift + 1e-9, _EXPORT_LIMITS.shift_step
    )
    loss, correlation, offset, scatter, factor = np.inf, -1.0, 0.0, np.inf, 0.0
    for shift in shifts:
        level = nominal.at(true_log_freq - shift)
        known = np.isfinite(level)
        if known.sum() < _EXPORT_LIMITS.min_bins:
            continue
        difference = expected[known] - level[known]
        if (size := float(np.median(np.abs(difference)))) < loss:
            loss, offset = size, float(np.median(difference))
        middle = float(np.median(difference))
        if (rest := float(np.median(np.abs(difference - middle)))) < scatter:
            scatter, factor = rest, middle
        correlation = max(
            correlation, _correlation(measured.log_freq[known], expected[known], level[known])
        )
    span = float(measured.log_freq[-1] - measured.log_freq[0])
    if not np.isfinite(loss):
        return None
    return _CurveAgreement(loss, correlation, offset, span, scatter, factor)


def _correlation(x: Real, first: Real, second: Real) -> float:
    """Return the correlation of two curves without their linear trends."""
    trend = np.stack([np.ones_like(x), x - x.mean()], axis=1)
    both = np.stack([first, second], axis=1)
    rest = both - trend @ np.linalg.lstsq(trend, both, rcond=None)[0]
    sizes = np.linalg.norm(rest, axis=0)
    return float(rest[:, 0] @ rest[:, 1] / max(sizes.prod(), 1e-300))
