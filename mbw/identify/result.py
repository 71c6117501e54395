"""Result of ``mbw identify``, collected once for its files, its table and its page."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification import BodyCheck, check_reciprocity, reduce_to_bodies
from identification.checks.reciprocity_findings import ChannelRatio
from identification.checks.setups import SetupCheck
from identification.level_check import LevelCheck
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
from identification.roving_hammer import is_roving_hammer
from identification.unknown_gains import leave_out_unknown_gains
from identification.words import Campaign, ModalModel, Port, Real
from mbw.identify.arrays import collect_arrays
from mbw.identify.files import BODY_NPZ, measured_estimate
from mbw.identify.hits import hits_rows
from mbw.identify.levels import level_row
from mbw.identify.reference_shapes import ReferenceModes
from mbw.identify.result_parts import MAX_NOISE_RATIO, ResultParts, derive_parts
from mbw.identify.solid import solid_row
from mbw.remarks import unknown_gain_sentences
from mbw.results.identified_files import IdentificationResult
from mbw.results.identified_schema import (
    IdentifiedModeRow,
    IdentifiedModesFile,
    SingleModeRow,
)

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
        quantity=parts.quantity,
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
    estimate = measured_estimate(parts.measured)
    first_line = estimate.select_lines(slice(0, 1))
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
