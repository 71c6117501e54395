"""Edits of the MJCF that hold the parameters of a model, and the parameters that it then holds."""

from collections.abc import Sequence

import numpy as np

from identification.words import Real
from mbmodel.mjcf.edit import Addition, Edit, NotInMjcf
from mbmodel.parts import AddedPart, BodyPart, ConditionalPart, JointPart, Part, body_parts
from mbmodel.parts.spring_laws import write_law_texts
from mbmodel.ports.rest_change import rest_lack
from mbmodel.posed_model import PosedModel

_PartValues = Sequence[tuple[Part, Real]]


def model_edits(model: PosedModel, theta: Real) -> tuple[Edit | Addition | NotInMjcf, ...]:
    """Return what theta asks to write into the MJCF, and what the MJCF cannot hold.

    Args:
        theta: parameters in SI; (n_parameter,).
    """
    values_of_parts = _values_of_parts(model, theta)
    added = _added_inertias(values_of_parts)
    edits: list[Edit | Addition | NotInMjcf] = []
    for part, values in values_of_parts:
        if isinstance(part, BodyPart):
            edits += part.write(values, added.pop(part.location, None))
        else:
            edits += part.write(values)
    edits += write_law_texts(model.machine.springs)
    edits += [not_held for loop in model.loops for not_held in loop.write(np.zeros(0))]
    edits += rest_lack(model.machine)
    bodies = {part.location: part for part in body_parts(model.machine)} if added else {}
    for place, inertia in added.items():
        drawn = np.array([parameter.drawn for parameter in bodies[place].parameters])
        edits += bodies[place].write(drawn, inertia)
    return tuple(_at_tuned_joint(model, edit, values_of_parts) for edit in edits)


def split_edits(
    model: PosedModel, theta: Real
) -> tuple[list[Edit | Addition], list[Edit | Addition]]:
    """Return the edits of the linear machine, and those of laws that act in tests alone.

    Args:
        theta: parameters in SI; (n_parameter,).
    """
    laws = [
        edit
        for part, values in _values_of_parts(model, theta)
        if isinstance(part, ConditionalPart) and not part.acts(None)
        for edit in part.write(values)
        if not isinstance(edit, NotInMjcf)
    ]
    linear = [
        edit
        for edit in model_edits(model, theta)
        if not isinstance(edit, NotInMjcf) and edit not in laws
    ]
    return linear, laws


def held_parameters(model: PosedModel, theta: Real) -> Real:
    """Return the parameters that the MJCF holds once theta is written; (n_parameter,).

    Args:
        theta: parameters in SI; (n_parameter,).
    """
    values_of_parts = _values_of_parts(model, theta)
    added = _added_inertias(values_of_parts)
    held = [
        part.select_held(values, added.get(part.location))
        if isinstance(part, BodyPart)
        else part.select_held(values)
        for part, values in values_of_parts
    ]
    return np.concatenate([*held, np.zeros(0)])


def _values_of_parts(model: PosedModel, theta: Real) -> list[tuple[Part, Real]]:
    """Return each Part with its parameters."""
    return list(zip(model.parts, model.split_parameters(theta), strict=True))


def _added_inertias(values_of_parts: _PartValues) -> dict[str, Real]:
    """Return the spatial inertia that Parts add to bodies, by the body's location; (6, 6) each."""
    added: dict[str, Real] = {}
    for part, values in values_of_parts:
        if isinstance(part, AddedPart) and part.weighs is not None and values.any():
            added[part.location] = part.weighs(values) + added.get(part.location, 0.0)
    return added


def _at_tuned_joint(
    model: PosedModel, edit: Edit | Addition | NotInMjcf, values_of_parts: _PartValues
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
