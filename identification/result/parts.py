"""Quantities derived from a modal model, for the files, table and page of ``mbw identify``.

Reference shapes for the measured modes, such as those of a file, and their comparison.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identification.modal import (
    BodyShapes,
    IdentifiedModes,
    MeasuredFrfs,
    ScaledModes,
    SynthesisError,
    find_combination_tones,
    find_doubtful_modes,
    full_matrix_model,
    mac,
    negative_drive_points,
    negative_residue_phrase,
    pair_shapes,
    real_shapes,
    scale_shapes,
    select_reciprocal_modes,
    shapes_at_bodies,
    signed_comac,
    synthesis_error,
    synthesise_frfs,
)
from identification.readers.uff_modes import read_uff_modes
from identification.words import (
    Campaign,
    Complex,
    InputError,
    Layout,
    Mask,
    ModalModel,
    Output,
    Real,
)

_MIN_PAIR_MAC = 0.3  # lowest MAC of a measured and a reference mode that count as a pair


@dataclass(frozen=True, eq=False)
class ReferenceModes:
    """Modes of a model or of a file at the measured channels.

    Args:
        name: name of the model or file.
        freq_hz: natural frequencies [Hz]; (n_reference,).
        damping: damping ratios; (n_reference,).
        shapes: mode shapes; (n_out, n_reference).
        has_shape: channels at which the shapes are known; (n_out,).
        remarks: sentences on the file, such as axes that it turns.
    """

    name: str
    freq_hz: Real
    damping: Real
    shapes: Complex
    has_shape: Mask
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class ShapeComparison:
    """Comparison of measured shapes with reference shapes.

    Args:
        reference: reference modes.
        mac: MAC of every measured with every reference shape; (n_mode, n_reference).
        pairs: indices of measured and reference modes that belong together.
        comac: signed COMAC over the pairs; zero where either side has no shape; (n_out,).
    """

    reference: ReferenceModes
    mac: Real
    pairs: tuple[tuple[int, int], ...]
    comac: Real


def compare_shapes(
    shapes: Complex, is_measured: Mask, reference: ReferenceModes
) -> ShapeComparison:
    """Compare measured shapes with reference shapes by MAC and signed COMAC.

    Args:
        shapes: measured shapes; (n_out, n_mode).
        is_measured: channels that were measured; (n_out,).
    """
    rows = np.flatnonzero(reference.has_shape & is_measured)
    criterion = mac(shapes[rows], reference.shapes[rows])
    pairs = tuple(pair_shapes(criterion, _MIN_PAIR_MAC)) if criterion.size else ()
    comac = np.zeros(len(shapes))
    if pairs:
        modes, partners = (list(side) for side in zip(*pairs, strict=True))
        comac[rows] = signed_comac(shapes[rows][:, modes], reference.shapes[rows][:, partners])
    return ShapeComparison(reference, criterion, pairs, comac)


def no_reference_modes(outputs: tuple[Output, ...]) -> ReferenceModes:
    """Return an empty set of reference modes."""
    n_out, empty = len(outputs), np.zeros(0)
    return ReferenceModes("", empty, empty, np.zeros((n_out, 0), complex), np.zeros(n_out, bool))


def read_reference_modes(path: Path, outputs: tuple[Output, ...], layout: Layout) -> ReferenceModes:
    """Read the modes of a universal file at the measured channels, matched by node numbers.

    Raises:
        InputError: the file holds no mode, or no node of the measurement.
    """
    modes = read_uff_modes(path)
    shapes, has_shape = modes.at_channels(outputs, layout)
    if not has_shape.any():
        nodes = ", ".join(str(node) for node in modes.nodes[:5])
        raise InputError(
            f"{path} has shapes at nodes {nodes}.., none of which was measured: give sensors and "
            "nodes the same numbers"
        )
    return ReferenceModes(path.name, modes.freq_hz, modes.damping, shapes, has_shape, modes.remarks)


MAX_NOISE_RATIO = 0.3  # noise of a channel over its FRF; noisier channels do not count


@dataclass(frozen=True, eq=False)
class ResultParts:
    """Modal model with the quantities derived from it.

    Args:
        campaign: measured campaign.
        all_lines: FRFs of all tests in one matrix.
        measured: the same, in a large test every n-th line alone, enough for files and page.
        identified: identification with its poles of all orders.
        model: modal model with scaled shapes.
        scaled: modal model together with its scaling ``a_r``.
        n_inside: number of modes inside the band; they come first.
        body_shapes: shapes of these modes at centres of mass.
        synthesised: synthesised FRFs; (n_freq, n_out, n_in).
        error: error of the synthesised FRFs.
        full_matrix_error: error of FRFs synthesised from shapes and ``a_r`` alone; None without a
            drive point among the outputs.
        real_shapes: real shapes of the modes inside the band; (n_out, n_mode).
        comparison: comparison of their shapes with the reference modes.
        is_measured: outputs that were measured; (n_out,).
        doubts: reasons to doubt each mode inside the band; n_mode.
    """

    campaign: Campaign
    all_lines: MeasuredFrfs
    measured: MeasuredFrfs
    identified: IdentifiedModes
    model: ModalModel
    scaled: ScaledModes
    n_inside: int
    body_shapes: BodyShapes
    synthesised: Complex
    error: SynthesisError
    full_matrix_error: SynthesisError | None
    real_shapes: Real
    comparison: ShapeComparison
    is_measured: Mask
    doubts: tuple[tuple[str, ...], ...]

    @property
    def thinning_remark(self) -> str:
        """Sentence on the lines of a large test that files and page hold; empty for all."""
        shown, count = len(self.measured.freq_hz), len(self.all_lines.freq_hz)
        if shown == count:
            return ""
        return (
            f"the test is large: modes and shapes are those of all {count} frequency lines; files "
            f"and page hold the curves of {shown} of them, and bodies are checked on a part of them"
        )

    @property
    def height(self) -> Real:
        """Contribution of each mode to the FRFs at its resonance, a weight for the COMAC."""
        model = self.model
        size = np.linalg.norm(model.shapes, axis=0) * np.linalg.norm(model.participation, axis=0)
        height: Real = size * np.abs(model.poles) ** self.measured.order / np.abs(model.poles.real)
        return height[: self.n_inside]


def derive_parts(
    campaign: Campaign,
    identified: tuple[ModalModel, IdentifiedModes, MeasuredFrfs],
    reference: ReferenceModes,
) -> ResultParts:
    """Derive all quantities of the result from an identification.

    Args:
        identified: return value of ``identification.modal.identify``.
    """
    model, modes, all_lines = identified
    measured = all_lines.thin_lines()
    order = np.argsort(~modes.inside, kind="stable")
    scaled = scale_shapes(model, campaign.layout, modes.residue_sd[:, :, order])
    n_inside = int(modes.inside.sum())
    shapes = scaled.model.shapes[:, :n_inside]
    is_measured = np.asarray(measured.measured.any(axis=1), np.bool_)
    rows = np.flatnonzero(is_measured)
    values = synthesise_frfs(scaled.model, measured)
    return ResultParts(
        campaign,
        all_lines,
        measured,
        modes,
        scaled.model,
        scaled,
        n_inside,
        shapes_at_bodies(shapes[rows], [measured.outputs[k] for k in rows], campaign.layout),
        values,
        synthesis_error(measured, values),
        _full_matrix_error(scaled, measured, n_inside),
        real_shapes(shapes),
        compare_shapes(shapes, is_measured, reference),
        is_measured,
        _find_doubts(scaled, modes, n_inside, modes.residue_sd[:, :, order]),
    )


def _find_doubts(
    scaled: ScaledModes, modes: IdentifiedModes, n_inside: int, residue_sd: Real
) -> tuple[tuple[str, ...], ...]:
    """Return the reasons to doubt each mode inside the band."""
    inside = np.arange(len(scaled.model.poles)) < n_inside
    doubts = find_doubtful_modes(scaled.model, n_inside, modes.misfit, scaled.reciprocity)
    reasons = [list(of_mode) for of_mode in doubts]
    for point, negative in negative_drive_points(scaled.model, residue_sd, inside).items():
        for mode in negative:
            reasons[mode].append(negative_residue_phrase(point))
    for mode, reason in find_combination_tones(scaled.model, n_inside).items():
        reasons[mode].append(reason)
    return tuple(map(tuple, reasons))


def _full_matrix_error(
    scaled: ScaledModes, measured: MeasuredFrfs, n_inside: int
) -> SynthesisError | None:
    """Compute the error of the measured columns of the full FRF matrix (seed, sec. 3.3)."""
    if not scaled.has_scale or not set(measured.inputs) <= set(measured.outputs):
        return None
    full = full_matrix_model(scaled, select_reciprocal_modes(scaled, n_inside))
    columns = [measured.outputs.index(dof) for dof in measured.inputs]
    driven = replace(
        full,
        participation=full.participation[columns],
        lower=full.lower[:, columns],
        upper=full.upper[:, columns],
        inputs=measured.inputs,
    )
    return synthesis_error(measured, synthesise_frfs(driven, measured))
