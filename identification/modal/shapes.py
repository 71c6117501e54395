"""Scaling of mode shapes by a_r, real mode shapes, and shapes at the centres of mass of bodies.

With eigenvalues s_r (seed, eq. 3.4), shapes phi_r and one scaling a_r a mode, receptance is

    H(s) = sum_r phi_r phi_r^T / (a_r (s - s_r)) + its conjugate   (seed, eq. 3.5 to 3.7),

accelerance s^2 times that; s = i w, convention exp(+i w t). A shape c phi_r has the scaling c^2
a_r, so that phi_r^T A phi_r = a_r with the state matrix A = [C M; M 0] (Ewins 2000, ch. 2.8). A
real mode of modal mass m has a_r = 2 i w_d m, w_d = Im s_r. Here shapes are given the phase and
size at which a_r = 2 i w_d * 1 kg. For real modes this is phi^T M phi = 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from identification.modal.close_modes import group_close_poles, separate_close_modes
from identification.modal.indicators import mac
from identification.solid import reconstruct, reduce_to_bodies
from identification.words import (
    Complex,
    Dof,
    Frf,
    FrfEstimate,
    Layout,
    Mask,
    ModalModel,
    Output,
    Real,
    drive_point_scale,
)

UNIT_MASS = "unit modal mass"
UNIT_LARGEST = "largest entry 1"


@dataclass(frozen=True, eq=False)
class ScaledModes:
    """A modal model whose shapes have a defined size.

    Args:
        model: shapes phi_r c_r and participation l_r / c_r, which give the same FRFs.
        normalisation: ``unit modal mass``, a_r = 2 i Im s_r kg and shapes in kg^-1/2; without a
            drive point ``largest entry 1``, without a unit.
        modal_a: a_r of receptance [kg/s]; (n_mode,), empty without a drive point.
        reciprocity: MAC of shape and participation at the drive points, 1 where forces and motions
            may be exchanged; (n_mode,), empty with fewer than two drive points.
        scale_sd: relative standard deviation of the size of each shape, by the noise at the drive
            points; (n_mode,), empty where it is not known.
    """

    model: ModalModel
    normalisation: str
    modal_a: Complex
    reciprocity: Real
    scale_sd: Real = field(default_factory=lambda: np.zeros(0))

    @property
    def has_scale(self) -> bool:
        """Whether a_r is known."""
        return self.normalisation == UNIT_MASS


def scale_shapes(
    model: ModalModel, layout: Layout | None = None, residue_sd: Real | None = None
) -> ScaledModes:
    """Scale every shape in size and phase, such that its largest entry has a positive real part.

    If no input is an output too, the shape at the impact point is that of the hammered body's rigid
    motion, along the direction of the force. Modes whose poles lie within each other's uncertainty
    have the shapes that their common residue matrix gives (``close_modes``).

    Args:
        model: any scaling.
        layout: bodies and points, if known.
        residue_sd: standard deviations of the residues, if known; (n_out, n_in, n_mode).
    """
    separated = separate_close_modes(model, *_drive_point_shapes(model, layout))
    model, (driven, participation) = separated, _drive_point_shapes(separated, layout)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = drive_point_scale(driven, participation)
    has_scale_factor = len(driven) > 0 and bool((np.isfinite(scale) & (scale != 0)).all())
    largest, modal_a = (
        _largest_entries(model.shapes),
        np.asarray(2j * model.poles.imag, np.complex128),
    )
    if has_scale_factor:
        factor = np.sqrt(modal_a / scale)
        # A negative residue at the drive point, which no passive machine has, makes no shape
        # imaginary: ``drive_residues`` names it.
        is_negative = ((driven * participation).sum(axis=0) * modal_a).real < 0
        factor = factor * np.where(is_negative, 1j, 1.0)
        factor = factor * np.where((largest * factor).real < 0, -1.0, 1.0)
    else:
        factor = 1.0 / np.where(largest == 0, 1.0, largest)
    rescaled = replace(
        model, shapes=model.shapes * factor, participation=model.participation / factor
    )
    has_several = has_scale_factor and len(driven) > 1
    return ScaledModes(
        rescaled,
        UNIT_MASS if has_scale_factor else UNIT_LARGEST,
        modal_a if has_scale_factor else np.zeros(0, np.complex128),
        np.diag(mac(driven, participation)).copy() if has_several else np.zeros(0),
        _scale_deviation(rescaled, residue_sd) if has_scale_factor else np.zeros(0),
    )


def _scale_deviation(model: ModalModel, residue_sd: Real | None) -> Real:
    """Return the relative standard deviation of the size of mass-normalised shapes; (n_mode,).

    The drive points d give 1 / a = sum |phi_d|^2 R_dd / phi_d^2 / sum |phi_d|^2, R_dd the residues.
    The size of a shape is proportional to a^-1/2, so that it has half the relative error. Near a
    node phi_d is small, and the error large. In a group of close poles, where only the sum of
    residues is determined, the smallest deviation of the group stands for that of the sum.

    Args:
        model: shapes of unit modal mass.
    """
    outputs = {dof.positive: row for row, dof in enumerate(model.outputs)}
    cells = [
        (outputs[dof.positive], column)
        for column, dof in enumerate(model.inputs)
        if isinstance(dof, Dof) and dof.positive in outputs
    ]
    if residue_sd is None or not cells:
        return np.zeros(0)
    rows, columns = np.array(cells).T
    variance = (residue_sd[rows, columns] ** 2).sum(axis=0)
    for group in group_close_poles(model):
        variance[list(group)] = variance[list(group)].min()
    size = (np.abs(model.shapes[rows]) ** 2).sum(axis=0)
    return np.abs(model.poles.imag) * np.sqrt(variance) / np.maximum(size, 1e-300)


def _largest_entries(shapes: Complex) -> Complex:
    """Return the entry of largest modulus of each shape; (n_mode,)."""
    return shapes[np.abs(shapes).argmax(axis=0), np.arange(shapes.shape[1])]


def _drive_point_shapes(model: ModalModel, layout: Layout | None) -> tuple[Complex, Complex]:
    """Return shapes and participation at the points where both are known; (n, n_mode) each."""
    driven, participation = model.drive_points
    if len(driven) or layout is None:
        return driven, participation
    bodies = shapes_at_bodies(model.shapes, model.outputs, layout)
    places = set(layout.points) - {
        p for p in layout.points if layout.body_name(p) in bodies.undetermined
    }
    known_inputs = [
        (k, d) for k, d in enumerate(model.inputs) if isinstance(d, Dof) and d.point in places
    ]
    channel_rows = layout.rows([dof for _, dof in known_inputs])
    motion = np.zeros((channel_rows.shape[1], len(model.poles)), np.complex128)
    motion[[layout.body_dofs().index(dof) for dof in bodies.dofs]] = bodies.values
    driven = channel_rows @ motion
    return driven, model.participation[[k for k, _ in known_inputs]]


def real_shapes(shapes: Complex) -> Real:
    """Return the real part of each shape, rotated to the phase at which that part is largest.

    Sum Re(phi e^-ia)^2 = (sum |phi|^2 + Re(e^-2ia sum phi^2)) / 2 is largest at a = arg(sum phi^2)
    / 2. The size of the shape is kept: a mass-normalised shape stays mass-normalised.

    Args:
        shapes: shapes in columns; (n, n_mode).

    Returns:
        Real shapes whose largest entry is positive; (n, n_mode).
    """
    angle = np.angle((shapes**2).sum(axis=0)) / 2
    turned: Real = (shapes * np.exp(-1j * angle)).real
    return turned * np.where(_largest_entries(turned.astype(complex)).real < 0, -1.0, 1.0)


@dataclass(frozen=True, eq=False)
class BodyShapes:
    """Shapes at centres of mass, and the readings of the channels that they give.

    Args:
        dofs: determined degrees of freedom of the bodies, in world axes; n.
        values: translations [as the shapes], rotations [the same per m]; (n, n_mode).
        rebuilt: readings reconstructed from the motion of the bodies; (n_out, n_mode), zero where
            the body is not fully determined.
        solid: whether a channel is on a fully determined body; (n_out,).
        undetermined: bodies of which a degree of freedom is not determined.
    """

    dofs: tuple[Output, ...]
    values: Complex
    reconstructed: Complex
    solid: Mask
    undetermined: tuple[str, ...]


def shapes_at_bodies(shapes: Complex, outputs: Sequence[Output], layout: Layout) -> BodyShapes:
    """Compute the least-squares motion of each solid body, with equal weights (seed, eq. 2.5).

    Args:
        shapes: shapes in columns; (n_out, n_mode).
        outputs: their labels, points of the layout.
    """
    outputs = tuple(outputs)
    count = shapes.shape[1]
    nonempty = shapes if count else np.zeros((len(outputs), 1), complex)
    reduced = reduce_to_bodies(_shapes_as_estimate(nonempty, outputs), layout).frf
    determined = set(reduced.outputs)
    complete = {b for b in layout.bodies if all(Dof.of(b, axis) in determined for axis in range(6))}
    solid = np.array(
        [isinstance(d, Dof) and layout.body_name(d.point) in complete for d in outputs], bool
    )
    rebuilt = np.zeros(shapes.shape, complex)
    if solid.any():
        kept = tuple(dof for dof, inside in zip(outputs, solid, strict=True) if inside)
        rebuilt[solid] = reconstruct(reduced, kept, layout).values[:count, :, 0].T
    return BodyShapes(
        reduced.outputs,
        reduced.values[:count, :, 0].T,
        rebuilt,
        solid,
        tuple(body for body in layout.bodies if body not in complete),
    )


def _shapes_as_estimate(shapes: Complex, outputs: tuple[Output, ...]) -> FrfEstimate:
    """Store shapes as the lines of an FRF, since bodies reduce modes and lines equally."""
    values = shapes.T[:, :, None]
    lines = np.arange(1, shapes.shape[1] + 1, dtype=np.float64)
    frf = Frf(lines, values, outputs, (outputs[0],), "receptance")
    measured = np.ones(values.shape[1:], bool)
    return FrfEstimate(frf, np.ones(values.shape), "differences", measured)
