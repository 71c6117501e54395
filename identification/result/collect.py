"""Result of ``mbw identify``, collected once for its files, its table and its page."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.checks.reciprocity import check_reciprocity
from identification.checks.reciprocity_findings import ChannelRatio
from identification.checks.setups import SetupCheck, compare_setups
from identification.level_check import LevelCheck, check_hits, check_levels
from identification.modal import (
    IdentifiedModes,
    MeasuredFrfs,
    ModeCriteria,
    SingleModeCheck,
    SynthesisError,
    check_single_modes,
    mpc,
    mpd,
)
from identification.result.arrays import collect_arrays
from identification.result.hits import hits_rows
from identification.result.parts import MAX_NOISE_RATIO, ReferenceModes, ResultParts, derive_parts
from identification.result.schema import (
    IdentifiedModeRow,
    IdentifiedModesFile,
    LevelCheckRow,
    LevelTrendRow,
    SingleModeRow,
    SolidRow,
)
from identification.result.stored_result import BODY_NPZ, IdentificationResult
from identification.roving_hammer import exchange_hits_and_channels, is_roving_hammer
from identification.solid import BodyCheck, check_bodies, reduce_to_bodies
from identification.unknown_gains import leave_out_unknown_gains, unknown_gain_sentences
from identification.words import Campaign, ModalModel, Port, Real

_MAX_REFINEMENT_SHIFT = 0.02  # relative distance of a pole before and after its refinement


@dataclass(frozen=True, eq=False)
class MeasurementChecks:
    """Checks of the measurement itself.

    Args:
        solid: rigid-body checks.
        setups: comparisons of tests with one reference.
        levels: modes against the level; None for a campaign of one level.
    """

    solid: Sequence[BodyCheck] = ()
    setups: Sequence[SetupCheck] = ()
    levels: LevelCheck | None = None


def check_measurement(
    campaign: Campaign, identified: tuple[ModalModel, IdentifiedModes, MeasuredFrfs]
) -> MeasurementChecks:
    """Check the bodies, the set-ups and the modes at each level of an identified campaign.

    Args:
        identified: return value of ``identification.modal.identify``.
    """
    model, modes, _ = identified
    inside = np.arange(len(model.poles)) < int(modes.inside.sum())
    is_roving = is_roving_hammer(campaign)
    return MeasurementChecks(
        check_bodies(exchange_hits_and_channels(campaign) if is_roving else campaign),
        compare_setups(campaign),
        check_levels(campaign) or check_hits(campaign, model, inside),
    )


def collect_result(
    campaign: Campaign,
    identified: tuple[ModalModel, IdentifiedModes, MeasuredFrfs],
    tolerances: ModeCriteria,
    *,
    reference: ReferenceModes,
    source: str,
    keyframe: str | None = None,
    checks: MeasurementChecks | None = None,
) -> IdentificationResult:
    """Collect the result of an identification.

    Args:
        identified: return value of ``identification.modal.identify``.
        source: path of the MJCF.
        keyframe: of the MJCF that gives the pose; None without a model.
        checks: checks of the bodies and of the set-ups; None for none.
    """
    parts = derive_parts(campaign, identified, reference)
    arrays = collect_arrays(parts, tolerances)
    summary = _summary(parts, source, checks or MeasurementChecks())
    summary = summary.model_copy(update={"keyframe": keyframe})
    return IdentificationResult(summary, arrays, campaign.layout)


def _summary(parts: ResultParts, source: str, checks: MeasurementChecks) -> IdentifiedModesFile:
    measured, scaled, error = parts.all_lines, parts.scaled, parts.error
    full_matrix = parts.full_matrix_error
    single_modes = check_single_modes(measured, parts.model)[: parts.n_inside]
    modes = [_row(parts, mode, check) for mode, check in enumerate(single_modes)]
    return IdentifiedModesFile(
        campaign=parts.campaign.name,
        model=source,
        band=(float(measured.freq_hz[0]), float(measured.freq_hz[-1])),
        lines=len(measured.freq_hz),
        quantity=measured.quantity,
        outputs=[str(dof) for dof in measured.outputs],
        inputs=[str(dof) for dof in measured.inputs],
        input_units=_input_units(parts.campaign, measured.inputs),
        roved=is_roving_hammer(parts.campaign),
        body_directions=[str(dof) for dof in parts.body_shapes.dofs],
        undetermined_bodies=list(parts.body_shapes.undetermined),
        body_frfs=_body_frf_file(parts),
        normalisation=scaled.normalisation,
        misfit=parts.identified.misfit,
        error=_rms(error, error.error),
        noise=_rms(error, error.noise),
        reciprocal_error=None if full_matrix is None else _rms(full_matrix, full_matrix.error),
        beside_band=len(parts.model.poles) - parts.n_inside,
        compared_with=parts.comparison.reference.name,
        modes=modes,
        solid=[solid_row(check) for check in checks.solid],
        hits=hits_rows(parts.campaign, modes),
        setups=[check.sentence for check in checks.setups],
        levels=level_row(checks.levels),
        reciprocity=_reciprocity_rows(parts.campaign),
        remarks=[
            *parts.campaign.remarks,
            *parts.comparison.reference.remarks,
            *unknown_gain_sentences(parts.campaign),
            *measured.corrections,
            *(check.sentence for check in checks.setups if check.agrees is False),
            *filter(None, [parts.thinning_remark]),
        ],
    )


def _input_units(campaign: Campaign, inputs: Sequence[Port]) -> list[str]:
    """Return the unit of what drives at each input, as the FRFs have it; empty if it is unknown.

    A gain that is estimated from the nominal model converts a signal to a force.
    """
    unknown = campaign.unknown_gains
    units = {
        test.condition.reference: test.condition.drive_unit
        for test in campaign.tests
        if not (unknown.nominal and test.condition.instrument in unknown.hammers)
    }
    return [units.get(dof, "") for dof in inputs]


def _reciprocity_rows(campaign: Campaign) -> list[ChannelRatio]:
    """Return what reciprocity says of channels and hits whose gains are known."""
    comparable = leave_out_unknown_gains(campaign)
    reciprocity = None if comparable is None else check_reciprocity(comparable)
    return list(reciprocity.rows) if reciprocity else []


def _body_frf_file(parts: ResultParts) -> str | None:
    """Return the file of the FRFs at the centres of mass; None if no motion is determined."""
    first_line = parts.measured.estimate.select_lines(slice(0, 1))
    return BODY_NPZ if reduce_to_bodies(first_line, parts.campaign.layout).frf.outputs else None


def _rms(error: SynthesisError, values: Real) -> float | None:
    """Return the root mean square over the channels that are not mostly noise; None without any."""
    quiet = error.known & (error.noise <= MAX_NOISE_RATIO)
    return float(np.sqrt((values[quiet] ** 2).mean())) if quiet.any() else None


def _row(parts: ResultParts, mode: int, check: SingleModeCheck) -> IdentifiedModeRow:
    model, scaled, shape = parts.model, parts.scaled, parts.model.shapes[:, mode]
    body, comparison = parts.body_shapes.values[:, mode], parts.comparison
    pair = dict(comparison.pairs).get(mode)
    scale = scaled.modal_a[mode] if scaled.has_scale else None
    return IdentifiedModeRow(
        frequency=float(model.freq_hz[mode]),
        frequency_sd=float(model.freq_sd[mode]),
        damping=float(model.damping[mode]),
        damping_sd=float(model.damping_sd[mode]),
        real=float(model.poles[mode].real),
        imaginary=float(model.poles[mode].imag),
        modal_a_real=None if scale is None else float(scale.real),
        modal_a_imaginary=None if scale is None else float(scale.imag),
        phase_collinearity=float(mpc(shape[:, None])[0]),
        phase_deviation=float(mpd(shape[:, None])[0]),
        reciprocity=float(scaled.reciprocity[mode]) if len(scaled.reciprocity) else None,
        orders=_count_orders(model.poles[mode], parts.identified),
        other=None if pair is None else float(comparison.reference.freq_hz[pair]),
        other_mac=None if pair is None else float(comparison.mac[mode, pair]),
        shape_real=shape.real.tolist(),
        shape_imaginary=shape.imag.tolist(),
        real_shape=parts.real_shapes[:, mode].tolist(),
        body_shape_real=body.real.tolist(),
        body_shape_imaginary=body.imag.tolist(),
        by_hand=SingleModeRow.model_validate(check),
        scale_sd=float(scaled.scale_sd[mode]) if len(scaled.scale_sd) else None,
        doubtful=list(parts.doubts[mode]),
    )


def _count_orders(pole: complex, identified: IdentifiedModes) -> int | None:
    """Return the number of model orders that held a mode before its refinement.

    It is None for a mode that a later search added.
    """
    counts = [
        cluster.count
        for cluster in identified.clusters
        if abs(cluster.pole - pole) < _MAX_REFINEMENT_SHIFT * abs(pole)
    ]
    return max(counts) if counts else None


def level_row(check: LevelCheck | None) -> LevelCheckRow | None:
    """Return the row of modes.json; None for a campaign of one level."""
    if check is None:
        return None
    modes = [
        LevelTrendRow(
            frequency=trend.freq_hz.tolist(),
            frequency_sd=trend.freq_sd.tolist(),
            damping=trend.damping.tolist(),
            damping_sd=trend.damping_sd.tolist(),
            frequency_changes=frequency_changes,
            damping_changes=damping_changes,
        )
        for trend, (frequency_changes, damping_changes) in zip(
            check.trends, check.changed, strict=True
        )
    ]
    return LevelCheckRow(
        level=check.level_n.tolist(),
        unit=check.unit,
        effects=[] if check.is_constant else None,
        words=check.sentence,
        returns=check.returns,
        within_tests=check.is_within_tests,
        modes=modes,
    )


def solid_row(check: BodyCheck) -> SolidRow:
    """Return a body's row of ``modes.json``."""
    kept = np.isfinite(check.deviation)
    return SolidRow(
        body=check.body,
        channels=len(check.channels),
        spare=check.redundant,
        solid_to=check.solid_to_hz,
        words=check.sentence,
        frequency=check.freq_hz[kept].tolist(),
        deviation=check.deviation[kept].tolist(),
        faults=list(check.faults),
        more=check.has_unexplained,
        twins=list(check.confounded),
        unseen=list(check.unidentifiable),
    )
