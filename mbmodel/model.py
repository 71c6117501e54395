"""A machine with its Parts, assembled to M, C and K at given parameters."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.words import Condition, Real, UsageError
from mbmodel.machine import Machine
from mbmodel.parts import Change, Parameter, Part, Situation, spring_parts


@dataclass(frozen=True, eq=False)
class Matrices:
    """The equation of motion M q'' + C q' + K q = T' P f, in joint coordinates; (nv, nv) each."""

    mass: Real
    damping: Real
    stiffness: Real

    def dynamic_stiffness(self, laplace: complex) -> np.ndarray[tuple[int, int], np.dtype]:
        """Z(s) = s^2 M + s C + K; (nv, nv)."""
        return laplace**2 * self.mass + laplace * self.damping + self.stiffness


@dataclass(frozen=True, eq=False)
class Model:
    """A machine and the Parts that act on it; theta lists all their parameters, Part by Part.

    Raises:
        ValueError: two parameters with one name.
    """

    machine: Machine
    parts: tuple[Part, ...]

    def __post_init__(self) -> None:
        """Check that names are unique."""
        names = [parameter.name for parameter in self.parameters]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"parameters named twice: {', '.join(twice)}")

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """All parameters in the order of theta."""
        return tuple(parameter for part in self.parts for parameter in part.parameters)

    @cached_property
    def drawn(self) -> Real:
        """Theta on the drawing; (n_parameter,)."""
        return np.array([parameter.drawn for parameter in self.parameters])

    @cached_property
    def locations(self) -> tuple[str, ...]:
        """Location of each parameter."""
        return tuple(part.location for part in self.parts for _ in part.parameters)

    def pieces(self, theta: Real) -> tuple[Real, ...]:
        """Split theta into one array a Part.

        Raises:
            UsageError: another length than the model's.
        """
        if np.shape(theta) != (len(self.parameters),):
            raise UsageError(
                f"theta has shape {np.shape(theta)}, expected ({len(self.parameters)},)"
            )
        ends = np.cumsum([len(part.parameters) for part in self.parts])
        return tuple(np.split(theta, ends)[:-1])

    def frames(self, change: Change) -> tuple[Real, Real]:
        """Left and right factors of a change in joint coordinates; (nv, r) each."""
        if change.slot == "joint":
            return change.left, change.right
        transposed = self.machine.jacobian.T
        return transposed @ change.left, transposed @ change.right

    @cached_property
    def _fixed(self) -> Real:
        machine = self.machine
        return np.stack([machine.remaining_stiffness, machine.remaining_damping, machine.mass])

    def matrices(self, theta: Real, condition: Condition | None = None) -> Matrices:
        """Assemble M, C and K at theta.

        Args:
            theta: parameters in SI; (n_parameter,).
            condition: of the test meant, for Parts that act in some tests only.
        """
        total = self._fixed.copy()
        situation = Situation(self.machine, condition)
        for part, piece in zip(self.parts, self.pieces(theta), strict=True):
            for change in part.changes(piece, situation):
                left, right = self.frames(change)
                total += left @ change.core @ right.T
        stiffness, damping, mass = total
        return Matrices(mass, damping, stiffness)

    def slopes(self, theta: Real, condition: Condition | None = None) -> list[tuple[Change, ...]]:
        """Exact derivatives of every Part's change, in the order of the Parts."""
        situation = Situation(self.machine, condition)
        return [
            part.slopes(piece, situation)
            for part, piece in zip(self.parts, self.pieces(theta), strict=True)
        ]


def as_drawn(machine: Machine) -> Model:
    """The machine with the springs and dampers of its joints and tendons as Parts."""
    return Model(machine, spring_parts(machine))
