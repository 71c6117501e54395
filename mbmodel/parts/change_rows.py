"""Rows of a change for another machine, which has its bodies and joints and perhaps others."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from identification.words import Real
from mbmodel.machine import Machine
from mbmodel.parts.added import AddedPart, Changes
from mbmodel.parts.part import Change, Slot

# What the rows of left and right count: bodies in six directions, joint coordinates, or neither.
_SPACES: dict[Slot, tuple[str, str]] = {
    "body": ("bodies", "bodies"),
    "joint": ("joints", "joints"),
    "path": ("bodies", "joints"),
    "sensor": ("", "bodies"),
    "hammer": ("", "bodies"),
    "input": ("", ""),
    "output": ("", ""),
}


@dataclass(frozen=True)
class RowNames:
    """Names of what the rows of a change count.

    Args:
        bodies: names of the bodies.
        joints: names of the joint coordinates.
    """

    bodies: tuple[str, ...]
    joints: tuple[str, ...]

    @classmethod
    def of(cls, machine: Machine) -> Self:
        """Return those of a machine."""
        return cls(machine.layout.bodies, machine.coordinates)

    def list_rows(self, space: str) -> list[str]:
        """Return a name for each row: of each motion of each body, or of each joint coordinate."""
        if space == "joints":
            return list(self.joints)
        return [f"{body} {axis}" for body in self.bodies for axis in range(6)]


def fit_change(change: Change, before: RowNames, after: RowNames) -> Change:
    """Return a change whose rows are those of another machine; what it lacks does not move.

    Args:
        change: whose rows count ``before``.
        before: names of its rows.
        after: names of the rows of the other machine.
    """
    left, right = _SPACES[change.slot]
    return replace(
        change,
        left=_place_rows(change.left, before.list_rows(left), after.list_rows(left), left),
        right=_place_rows(change.right, before.list_rows(right), after.list_rows(right), right),
    )


def _place_rows(matrix: Real, before: Sequence[str], after: Sequence[str], space: str) -> Real:
    """Return a matrix with each row at the place of its name; (n_after, n_column)."""
    if not space:
        return matrix
    if len(before) != len(matrix):
        raise ValueError(f"{len(matrix)} rows for {len(before)} motions")
    if before == after:
        return matrix
    placed = np.zeros((len(after), matrix.shape[1]))
    place_of = {name: number for number, name in enumerate(after)}
    for row, name in zip(matrix, before, strict=True):
        if name in place_of:
            placed[place_of[name]] = row
    return placed


def fit_part(part: AddedPart, before: RowNames, after: RowNames) -> AddedPart:
    """Return a Part for another machine, with equal parameters.

    Args:
        part: of the machine before.
        before: names of that machine's bodies and joints.
        after: names of those of the other machine.
    """

    def fit_all(changes: Changes) -> Changes:
        return lambda theta: tuple(fit_change(each, before, after) for each in changes(theta))

    return replace(part, finite=fit_all(part.finite), derivatives=fit_all(part.derivatives))
