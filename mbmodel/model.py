"""A machine with its Parts, assembled at given parameters."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from identification.words import Complex, Condition, Mask, Real, UsageError
from mbmodel.linearisation.gravity import gravity_slope, gravity_stiffness
from mbmodel.machine import Machine
from mbmodel.mjcf.edit import Addition, Edit, NotHeld
from mbmodel.parts import (
    AddedPart,
    BodyPart,
    Change,
    Conditional,
    JointPart,
    Parameter,
    Part,
    Situation,
    spring_parts,
)

T = TypeVar("T", bound=np.generic)


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
class ShapedTerm:
    """What is added to Z(s) and is no polynomial: f(s) left (core_0 + s core_1 + ..) right'.

    Args:
        left: (nv, r).
        right: (nv, t).
        change: at bodies or joints.
    """

    left: Real
    right: Real
    change: Change

    def at(self, laplace: Complex) -> Complex:
        """The core at each s; (n_freq, r, t)."""
        return shaped_core(self.change, laplace)


def shaped_core(change: Change, laplace: Complex) -> Complex:
    """F(s) (core_0 + s core_1 + s^2 core_2); (n_freq, r, t)."""
    powers = laplace[:, None] ** np.arange(3)
    if change.shape is not None:
        powers = powers * change.shape(laplace)[:, None]
    found: Complex = np.einsum("fk,krt->frt", powers, change.core)
    return found


@dataclass(frozen=True, eq=False)
class Assembly:
    """All factors of the equation at one theta.

    Args:
        machine: whose they are.
        jacobian: T; (6 n_body, nv).
        matrices: M, C, K in joint coordinates.
        body_changes: what Parts add to Zb.
        point_changes: what Parts add at sensors and hammer.
        shaped: what Parts add to Zb and Zj that is no polynomial in s.
    """

    machine: Machine
    jacobian: Real
    matrices: Matrices
    body_changes: tuple[Change, ...]
    point_changes: tuple[Change, ...]
    shaped: tuple[ShapedTerm, ...] = ()

    @cached_property
    def body(self) -> Real:
        """Zb: coefficients of s^0, s^1, s^2; (3, 6 n_body, 6 n_body)."""
        size = len(self.machine.body_mass)
        total = np.zeros((3, size, size))
        total[2] = self.machine.body_mass
        for change in self.body_changes:
            total += change.left @ change.core @ change.right.T
        return total

    @property
    def heavy(self) -> Real:
        """Mb, its rows times the share of weight that gravcomp leaves; (6 n_body, 6 n_body)."""
        heavy: Real = self.machine.weighed[:, None] * self.body[2]
        return heavy

    @property
    def has_weight(self) -> bool:
        """Whether gravity is on."""
        return bool(self.machine.gravity.any())


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
        twice = sorted(name for name, many in Counter(names).items() if many > 1)
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

    def pieces(self, theta: NDArray[T]) -> tuple[NDArray[T], ...]:
        """Split theta into one array a Part.

        Raises:
            UsageError: another length than the model's.
        """
        if np.shape(theta) != (len(self.parameters),):
            raise UsageError(
                f"theta has shape {np.shape(theta)}, expected ({len(self.parameters)},)"
            )
        return tuple(theta[span] for span in self._spans)

    @cached_property
    def _spans(self) -> tuple[slice, ...]:
        """Where the parameters of each Part lie in theta."""
        ends = accumulate((len(part.parameters) for part in self.parts), initial=0)
        return tuple(slice(*both) for both in pairwise(ends))

    @cached_property
    def _conditional(self) -> tuple[Conditional, ...]:
        return tuple(part for part in self.parts if isinstance(part, Conditional))

    @cached_property
    def _as_drawn(self) -> Real:
        """Coefficients of s^0, s^1, s^2 without any Part; (3, nv, nv)."""
        machine = self.machine
        return self._without_parts(machine.jacobian, machine.body_mass[None] * _MASS)

    def _without_parts(self, jacobian: Real, body: Real) -> Real:
        """The bodies, gravity, and what no Part changes; (3, nv, nv)."""
        machine = self.machine
        total = np.stack([machine.remaining_stiffness, machine.remaining_damping, machine.armature])
        for power in np.flatnonzero(body.any(axis=(1, 2))):
            total[power] += jacobian.T @ body[power] @ jacobian
        if machine.gravity.any():
            heavy = machine.weighed[:, None] * body[2]
            total[0] += gravity_stiffness(machine.gravity, machine.order, jacobian, heavy)
        return total

    def assemble(self, theta: Real, condition: Condition | None = None) -> Assembly:
        """Assemble T, M, C, K and what changes at sensors and hammer.

        Args:
            theta: parameters in SI; (n_parameter,).
            condition: of the test meant, for Parts that act in some tests only.
        """
        machine = self.machine
        situation = Situation(machine, condition)
        found: dict[str, list[Change]] = {"joint": [], "body": [], "path": [], "point": []}
        shaped: list[Change] = []
        for part, piece in zip(self.parts, self.pieces(theta), strict=True):
            for change in part.changes(piece, situation):
                if change.shape is not None:
                    shaped += [change] if change.core.any() else []
                else:
                    found[change.slot if change.slot in found else "point"].append(change)
        jacobian, total = self._moved(found["path"], found["body"])
        for change in found["joint"]:
            add_product(total, change.left, change.core, change.right)
        stiffness, damping, mass = total
        return Assembly(
            machine,
            jacobian,
            Matrices(mass, damping, stiffness),
            tuple(found["body"]),
            tuple(found["point"]),
            tuple(_shaped_term(change, jacobian) for change in shaped),
        )

    def _moved(self, path: Sequence[Change], body: Sequence[Change]) -> tuple[Real, Real]:
        """T, and the coefficients of bodies and gravity with what Parts add to both."""
        machine = self.machine
        jacobian = machine.jacobian
        if not path:
            total = self._as_drawn.copy()
        else:
            jacobian = jacobian + sum(c.left @ c.core[0] @ c.right.T for c in path)
            total = self._without_parts(jacobian, machine.body_mass[None] * _MASS)
        for change in body:
            left, right = jacobian.T @ change.left, jacobian.T @ change.right
            add_product(total, left, change.core, right)
            if machine.gravity.any() and change.core[2].any():
                added = change.left @ change.core[2] @ change.right.T
                total[0] += gravity_slope(
                    machine.gravity,
                    machine.order,
                    jacobian,
                    machine.body_mass,
                    inertia_change=machine.weighed[:, None] * added,
                )
        return jacobian, total

    def acting(self, condition: Condition | None) -> tuple[float, ...]:
        """How much of the Parts that act in some tests only acts in this one, in their order."""
        return tuple(part.acts(condition) for part in self._conditional)

    def matrices(self, theta: Real, condition: Condition | None = None) -> Matrices:
        """Assemble M, C and K at theta; see ``assemble``."""
        return self.assemble(theta, condition).matrices

    def edits(self, theta: Real) -> tuple[Edit | Addition | NotHeld, ...]:
        """What theta asks to be written into the MJCF, and what that cannot hold."""
        pieces = list(zip(self.parts, self.pieces(theta), strict=True))
        more: dict[str, Real] = {}
        for part, piece in pieces:
            if isinstance(part, AddedPart) and part.weighs is not None and piece.any():
                more[part.location] = part.weighs(piece) + more.get(part.location, 0.0)
        found: list[Edit | Addition | NotHeld] = []
        for part, piece in pieces:
            if isinstance(part, BodyPart):
                found += part.write(piece, more.pop(part.location, None))
            else:
                found += part.write(piece)
        found += [NotHeld(place, "the model has no Part for its mass") for place in more]
        return tuple(self._with_its_joint(one, pieces) for one in found)

    def _with_its_joint(
        self, one: Edit | Addition | NotHeld, pieces: Sequence[tuple[Part, Real]]
    ) -> Edit | Addition | NotHeld:
        """A joint more goes where the others of its stage are tuned to; all else stays."""
        if not isinstance(one, Addition) or one.element.tag != "joint":
            return one
        frame = self.machine.drawing.bodies[one.parent].frame
        return next(
            (
                part.carried(piece, one, frame)
                for part, piece in pieces
                if isinstance(part, JointPart) and part.stage == one.parent and piece.any()
            ),
            one,
        )

    def slopes(
        self, theta: Real, condition: Condition | None = None, chosen: Mask | None = None
    ) -> list[tuple[Change, ...]]:
        """Exact derivatives of every Part's change, in the order of the Parts.

        Args:
            theta: parameters in SI; (n_parameter,).
            condition: of the test meant.
            chosen: parameters asked for: Parts without one have no slopes; (n_parameter,).
        """
        situation = Situation(self.machine, condition)
        wanted = self.pieces(np.ones(len(theta), bool) if chosen is None else chosen)
        return [
            part.slopes(piece, situation) if mask.any() else ()
            for part, piece, mask in zip(self.parts, self.pieces(theta), wanted, strict=True)
        ]


_MASS = np.array([0.0, 0.0, 1.0])[:, None, None]


def _shaped_term(change: Change, jacobian: Real) -> ShapedTerm:
    if change.slot == "joint":
        return ShapedTerm(change.left, change.right, change)
    if change.slot != "body":
        raise ValueError(
            f"a change of slot {change.slot} has no dependence on frequency of its own"
        )
    return ShapedTerm(jacobian.T @ change.left, jacobian.T @ change.right, change)


def add_product(total: Real, left: Real, core: Real, right: Real) -> None:
    """Add left core right' to the coefficients of s^0, s^1, s^2, in place.

    Most Parts touch a few coordinates only, so that only their rows and columns are worked on.
    """
    rows, columns = np.flatnonzero(left.any(axis=1)), np.flatnonzero(right.any(axis=1))
    for power in np.flatnonzero(core.any(axis=(1, 2))):
        total[power][np.ix_(rows, columns)] += left[rows] @ core[power] @ right[columns].T


def as_drawn(machine: Machine) -> Model:
    """The machine with the springs and dampers of its joints and tendons as Parts."""
    return Model(machine, spring_parts(machine))
