"""Edits of the MJCF that hold the parameters of a model."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from identification.words import Real
from mbmodel.mjcf.edit import Addition, Edit, NotInMjcf
from mbmodel.parts import AddedPart, BodyPart, JointPart, Part

if TYPE_CHECKING:
    from mbmodel.model import Model


def model_edits(model: "Model", theta: Real) -> tuple[Edit | Addition | NotInMjcf, ...]:
    """Return what theta asks to write into the MJCF, and what the MJCF cannot hold.

    Args:
        model: machine and Parts.
        theta: parameters in SI; (n_parameter,).
    """
    values_of_parts = list(zip(model.parts, model.split_parameters(theta), strict=True))
    added_inertias: dict[str, Real] = {}
    for part, values in values_of_parts:
        if isinstance(part, AddedPart) and part.weighs is not None and values.any():
            added_inertias[part.location] = part.weighs(values) + added_inertias.get(
                part.location, 0.0
            )
    edits: list[Edit | Addition | NotInMjcf] = []
    for part, values in values_of_parts:
        if isinstance(part, BodyPart):
            edits += part.write(values, added_inertias.pop(part.location, None))
        else:
            edits += part.write(values)
    edits += [not_held for loop in model.loops for not_held in loop.write(np.zeros(0))]
    edits += [
        NotInMjcf(place, "the model has no Part for the mass of this body")
        for place in added_inertias
    ]
    return tuple(_at_tuned_joint(model, edit, values_of_parts) for edit in edits)


def _at_tuned_joint(
    model: "Model", edit: Edit | Addition | NotInMjcf, values_of_parts: Sequence[tuple[Part, Real]]
) -> Edit | Addition | NotInMjcf:
    """Move an additional joint with the tuned joints of its stage; return other edits."""
    if not isinstance(edit, Addition) or edit.element.tag != "joint":
        return edit
    frame = model.machine.drawing.bodies[edit.parent].frame
    return next(
        (
            part.move_addition(values, edit, frame)
            for part, values in values_of_parts
            if isinstance(part, JointPart) and part.stage == edit.parent and values.any()
        ),
        edit,
    )
