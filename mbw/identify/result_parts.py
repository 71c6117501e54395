"""What the files, the table and the page of ``mbw identify`` are made of."""

from dataclasses import dataclass, replace

import numpy as np

from identification.modal import (
    BodyShapes,
    Identified,
    Measured,
    Scaled,
    SynthesisError,
    full_matrix,
    real_shapes,
    reciprocal,
    scaled,
    shapes_at_bodies,
    synthesis_error,
    synthesised,
)
from identification.words import ORDER, Campaign, Complex, Mask, ModalModel, Real
from mbw.identify.reference_shapes import Compared, Other, compared

QUIET = 0.3  # noise of a channel relative to its FRF, above which it does not count


@dataclass(frozen=True, eq=False)
class Parts:
    """A modal model and what follows from it.

    Args:
        campaign: what was measured.
        measured: the same side by side.
        found: how the modes were found.
        model: scaled.
        whole: the same with its scaling.
        inside: number of modes inside the band, which come first.
        bodies: shapes of those at centres of mass.
        values: synthesised FRFs; (n_freq, n_out, n_in).
        error: of these.
        alone: of those by shapes and a_r alone; None without a drive point among the outputs.
        real: real shapes of the modes inside the band; (n_out, n_mode).
        compared: their shapes beside others.
        seen: outputs that were measured; (n_out,).
    """

    campaign: Campaign
    measured: Measured
    found: Identified
    model: ModalModel
    whole: Scaled
    inside: int
    bodies: BodyShapes
    values: Complex
    error: SynthesisError
    alone: SynthesisError | None
    real: Real
    compared: Compared
    seen: Mask

    @property
    def quantity(self) -> str:
        """Of the FRFs."""
        return next(name for name, order in ORDER.items() if order == self.measured.order)

    @property
    def height(self) -> Real:
        """What each mode adds to the FRFs at its resonance, so that a faint one counts little."""
        model = self.model
        size = np.linalg.norm(model.shapes, axis=0) * np.linalg.norm(model.participation, axis=0)
        height: Real = size * np.abs(model.poles) ** self.measured.order / np.abs(model.poles.real)
        return height[: self.inside]


def parts_of(
    campaign: Campaign, identified: tuple[ModalModel, Identified, Measured], other: Other
) -> Parts:
    """Put together what ``identify`` found.

    Args:
        campaign: what it was found from.
        identified: by ``identification.modal.identify``.
        other: shapes to compare with.
    """
    model, found, measured = identified
    whole = scaled(model, campaign.layout)
    inside = int(found.inside.sum())
    shapes = whole.model.shapes[:, :inside]
    seen = np.asarray(measured.measured.any(axis=1), np.bool_)
    rows = np.flatnonzero(seen)
    values = synthesised(whole.model, measured)
    return Parts(
        campaign,
        measured,
        found,
        whole.model,
        whole,
        inside,
        shapes_at_bodies(shapes[rows], [measured.outputs[k] for k in rows], campaign.layout),
        values,
        synthesis_error(measured, values),
        _by_shapes_alone(whole, measured, inside),
        real_shapes(shapes),
        compared(shapes, seen, other),
        seen,
    )


def _by_shapes_alone(whole: Scaled, measured: Measured, inside: int) -> SynthesisError | None:
    """Error of the columns of the full matrix that were measured (seed, sec. 3.3)."""
    if not whole.has_scale or not set(measured.inputs) <= set(measured.outputs):
        return None
    full = full_matrix(whole, reciprocal(whole, inside))
    columns = [measured.outputs.index(dof) for dof in measured.inputs]
    driven = replace(
        full,
        participation=full.participation[columns],
        lower=full.lower[:, columns],
        upper=full.upper[:, columns],
        inputs=measured.inputs,
    )
    return synthesis_error(measured, synthesised(driven, measured))
