"""A model: a machine with its Parts, assembled to an equation of motion at given parameters."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate, pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from identification.words import Complex, Condition, Mask, Real, UsageError
from mbmodel.linearisation.gravity import gravity_slope, gravity_stiffness
from mbmodel.machine import Machine
from mbmodel.mjcf.edit import Addition, Edit, NotInMjcf
from mbmodel.parts import (
    AddedPart,
    BodyPart,
    Change,
    ConditionalPart,
    JointPart,
    Parameter,
    Part,
    PartContext,
    spring_parts,
)

T = TypeVar("T", bound=np.generic)

# Selects the coefficient of s^2 among (3, n, n): a mass matrix as a polynomial in s.
_MASS_POWER = np.array([0.0, 0.0, 1.0])[:, None, None]


@dataclass(frozen=True, eq=False)
class Matrices:
    """The equation of motion M q'' + C q' + K q = T' P f, in joint coordinates.

    Args:
        mass: M [kg, kg m^2]; (nv, nv).
        damping: C [N s/m, N m s/rad]; (nv, nv).
        stiffness: K [N/m, N m/rad]; (nv, nv).
    """

    mass: Real
    damping: Real
    stiffness: Real

    def dynamic_stiffness(self, laplace: complex) -> np.ndarray[tuple[int, int], np.dtype]:
        """Return Z(s) = s^2 M + s C + K at one complex s [rad/s]; (nv, nv)."""
        return laplace**2 * self.mass + laplace * self.damping + self.stiffness


@dataclass(frozen=True, eq=False)
class FrequencyDependentTerm:
    """A term of Z(s) that is no polynomial in s: ``f(s) left (core_0 + s core_1 + ...) right'``.

    Args:
        left: (nv, r).
        right: (nv, t).
        change: the change at bodies or joints that it comes from.
        owner: first parameter of its Part, or the Part's location without any.
    """

    left: Real
    right: Real
    change: Change
    owner: str = ""

    def at(self, laplace: Complex) -> Complex:
        """Return the core times f(s) at each s; (n_freq, r, t)."""
        return frequency_dependent_core(self.change, laplace)


def frequency_dependent_core(change: Change, laplace: Complex) -> Complex:
    """Return F(s) = f(s) (core_0 + s core_1 + s^2 core_2); (n_freq, r, t).

    Args:
        change: with its core (3, r, t), and f(s) if it has one.
        laplace: s [rad/s]; (n_freq,).
    """
    powers = laplace[:, None] ** np.arange(3)
    if change.shape is not None:
        powers = powers * change.shape(laplace)[:, None]
    core: Complex = np.einsum("fk,krt->frt", powers, change.core)
    return core


@dataclass(frozen=True, eq=False)
class Assembly:
    """All factors of the equation of motion at one theta.

    Args:
        machine: the machine.
        jacobian: T; (6 n_body, nv).
        matrices: M, C, K in joint coordinates.
        body_changes: what Parts add to Zb.
        point_changes: what Parts add at sensors and hammer.
        frequency_dependent: what Parts add to Zb and Zj that is no polynomial in s.
        input_changes: what each Part changes in the factor of the inputs, by the Part's number.
        output_changes: what Parts add to the logarithm of the readings' factors.
    """

    machine: Machine
    jacobian: Real
    matrices: Matrices
    body_changes: tuple[Change, ...]
    point_changes: tuple[Change, ...]
    frequency_dependent: tuple[FrequencyDependentTerm, ...] = ()
    input_changes: Mapping[int, tuple[Change, ...]] = field(default_factory=dict)
    output_changes: tuple[Change, ...] = ()

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
    def weight_bearing_mass(self) -> Real:
        """Mb, its rows times each body's weight fraction; (6 n_body, 6 n_body)."""
        weight_bearing_mass: Real = self.machine.weight_fraction[:, None] * self.body[2]
        return weight_bearing_mass

    @property
    def has_weight(self) -> bool:
        """Whether gravity is on."""
        return bool(self.machine.gravity.any())


@dataclass(frozen=True, eq=False)
class Model:
    """A machine and the Parts that act on it.

    The vector theta lists the parameters of all Parts, Part by Part, in SI units.

    Args:
        machine: at its static equilibrium.
        parts: in the order of theta.

    Raises:
        ValueError: two parameters with one name.
    """

    machine: Machine
    parts: tuple[Part, ...]

    def __post_init__(self) -> None:
        """Check that the names of parameters are unique."""
        names = [parameter.name for parameter in self.parameters]
        repeated = sorted(name for name, count in Counter(names).items() if count > 1)
        if repeated:
            raise ValueError(f"parameters with the same name: {', '.join(repeated)}: rename one")

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """All parameters in the order of theta."""
        return tuple(parameter for part in self.parts for parameter in part.parameters)

    @cached_property
    def drawn(self) -> Real:
        """Theta of the drawing, the nominal model; (n_parameter,)."""
        return np.array([parameter.drawn for parameter in self.parameters])

    @cached_property
    def locations(self) -> tuple[str, ...]:
        """Location of each parameter."""
        return tuple(part.location for part in self.parts for _ in part.parameters)

    def split_parameters(self, theta: NDArray[T]) -> tuple[NDArray[T], ...]:
        """Split theta, or any array of its shape, into one array per Part.

        Args:
            theta: (n_parameter,).

        Raises:
            UsageError: a length that is not that of the model's theta.
        """
        if np.shape(theta) != (len(self.parameters),):
            raise UsageError(
                f"theta has shape {np.shape(theta)}, expected ({len(self.parameters)},)"
            )
        return tuple(theta[span] for span in self._spans)

    @cached_property
    def _spans(self) -> tuple[slice, ...]:
        """Slice of theta for each Part."""
        ends = accumulate((len(part.parameters) for part in self.parts), initial=0)
        return tuple(slice(*both) for both in pairwise(ends))

    @cached_property
    def _conditional(self) -> tuple[ConditionalPart, ...]:
        """Parts that act in some tests only."""
        return tuple(part for part in self.parts if isinstance(part, ConditionalPart))

    @cached_property
    def _coefficients_as_drawn(self) -> Real:
        """Coefficients of s^0, s^1, s^2 without any Part; (3, nv, nv)."""
        machine = self.machine
        return self._coefficients(machine.jacobian, machine.body_mass[None] * _MASS_POWER)

    def _coefficients(self, jacobian: Real, body: Real) -> Real:
        """Return the coefficients of bodies, gravity and what no Part changes; (3, nv, nv).

        Args:
            jacobian: T; (6 n_body, nv).
            body: coefficients of s^0, s^1, s^2 of Zb; (3, 6 n_body, 6 n_body).
        """
        machine = self.machine
        total = np.stack([machine.remaining_stiffness, machine.remaining_damping, machine.armature])
        for power in np.flatnonzero(body.any(axis=(1, 2))):
            total[power] += jacobian.T @ body[power] @ jacobian
        if machine.gravity.any():
            weight_bearing_mass = machine.weight_fraction[:, None] * body[2]
            total[0] += gravity_stiffness(
                machine.gravity, machine.precedence, jacobian, weight_bearing_mass
            )
        return total

    def assemble(self, theta: Real, condition: Condition | None = None) -> Assembly:
        """Assemble T, M, C, K and the changes at sensors and hammer.

        Args:
            theta: parameters in SI; (n_parameter,).
            condition: of the test, for Parts that act in some tests only; None if no test is meant.
        """
        machine = self.machine
        context = PartContext(machine, condition)
        slots = "joint", "body", "path", "output", "point"
        by_slot: dict[str, list[Change]] = {slot: [] for slot in slots}
        frequency_dependent: list[tuple[Change, str]] = []
        input_changes: dict[int, list[Change]] = {}
        for number, values in enumerate(self.split_parameters(theta)):
            for change in self.parts[number].changes(values, context):
                if change.slot == "input":
                    input_changes.setdefault(number, []).append(change)
                elif change.shape is not None and change.slot != "output":
                    owner = next(
                        (parameter.name for parameter in self.parts[number].parameters),
                        self.parts[number].location,
                    )
                    frequency_dependent += [(change, owner)] if change.core.any() else []
                else:
                    by_slot[change.slot if change.slot in by_slot else "point"].append(change)
        jacobian, total = self._kinematics_and_coefficients(by_slot["path"], by_slot["body"])
        for change in by_slot["joint"]:
            add_product(total, change.left, change.core, change.right)
        stiffness, damping, mass = total
        return Assembly(
            machine,
            jacobian,
            Matrices(mass, damping, stiffness),
            tuple(by_slot["body"]),
            tuple(by_slot["point"]),
            tuple(
                replace(_frequency_dependent_term(change, jacobian), owner=owner)
                for change, owner in frequency_dependent
            ),
            {number: tuple(changes) for number, changes in input_changes.items()},
            tuple(by_slot["output"]),
        )

    def _kinematics_and_coefficients(
        self, path: Sequence[Change], body: Sequence[Change]
    ) -> tuple[Real, Real]:
        """Return T, and the coefficients of bodies and gravity, with the changes of Parts.

        Args:
            path: changes of T.
            body: changes of Zb.
        """
        machine = self.machine
        jacobian = machine.jacobian
        if not path:
            total = self._coefficients_as_drawn.copy()
        else:
            jacobian = jacobian + sum(c.left @ c.core[0] @ c.right.T for c in path)
            total = self._coefficients(jacobian, machine.body_mass[None] * _MASS_POWER)
        for change in body:
            left, right = jacobian.T @ change.left, jacobian.T @ change.right
            add_product(total, left, change.core, right)
            if machine.gravity.any() and change.core[2].any():
                added = change.left @ change.core[2] @ change.right.T
                total[0] += gravity_slope(
                    machine.gravity,
                    machine.precedence,
                    jacobian,
                    machine.body_mass,
                    inertia_change=machine.weight_fraction[:, None] * added,
                )
        return jacobian, total

    def acting_fractions(self, condition: Condition | None) -> tuple[float, ...]:
        """Return the fraction of each conditional Part that acts in a test, in their order."""
        return tuple(part.acts(condition) for part in self._conditional)

    def matrices(self, theta: Real, condition: Condition | None = None) -> Matrices:
        """Assemble M, C and K at theta; see ``assemble``."""
        return self.assemble(theta, condition).matrices

    def edits(self, theta: Real) -> tuple[Edit | Addition | NotInMjcf, ...]:
        """Return what theta asks to write into the MJCF, and what the MJCF cannot hold.

        Args:
            theta: parameters in SI; (n_parameter,).
        """
        values_of_parts = list(zip(self.parts, self.split_parameters(theta), strict=True))
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
        edits += [
            NotInMjcf(place, "the model has no Part for the mass of this body")
            for place in added_inertias
        ]
        return tuple(self._at_tuned_joint(edit, values_of_parts) for edit in edits)

    def _at_tuned_joint(
        self, edit: Edit | Addition | NotInMjcf, values_of_parts: Sequence[tuple[Part, Real]]
    ) -> Edit | Addition | NotInMjcf:
        """Move an additional joint with the tuned joints of its stage; return other edits."""
        if not isinstance(edit, Addition) or edit.element.tag != "joint":
            return edit
        frame = self.machine.drawing.bodies[edit.parent].frame
        return next(
            (
                part.move_addition(values, edit, frame)
                for part, values in values_of_parts
                if isinstance(part, JointPart) and part.stage == edit.parent and values.any()
            ),
            edit,
        )

    def slopes(
        self, theta: Real, condition: Condition | None = None, chosen: Mask | None = None
    ) -> list[tuple[Change, ...]]:
        """Return the exact derivatives of every Part's change, in the order of the Parts.

        Args:
            theta: parameters in SI; (n_parameter,).
            condition: of the test, or None.
            chosen: parameters of interest; Parts without one get no slopes; all if None;
                (n_parameter,).
        """
        context = PartContext(self.machine, condition)
        chosen_of_parts = self.split_parameters(
            np.ones(len(theta), bool) if chosen is None else chosen
        )
        return [
            part.slopes(values, context) if mask.any() else ()
            for part, values, mask in zip(
                self.parts, self.split_parameters(theta), chosen_of_parts, strict=True
            )
        ]


def _frequency_dependent_term(change: Change, jacobian: Real) -> FrequencyDependentTerm:
    """Return a change of joints or bodies in joint coordinates."""
    if change.slot == "joint":
        return FrequencyDependentTerm(change.left, change.right, change)
    if change.slot != "body":
        raise ValueError(
            f"a change in slot {change.slot} has a shape f(s): use the slots joint or body"
        )
    return FrequencyDependentTerm(jacobian.T @ change.left, jacobian.T @ change.right, change)


def add_product(total: Real, left: Real, core: Real, right: Real) -> None:
    """Add left core right' to the coefficients of s^0, s^1, s^2, in place.

    Most Parts touch a few coordinates only, so that only those rows and columns are computed.

    Args:
        total: coefficients; (3, n, n).
        left: (n, r).
        core: (3, r, t).
        right: (n, t).
    """
    rows, columns = np.flatnonzero(left.any(axis=1)), np.flatnonzero(right.any(axis=1))
    for power in np.flatnonzero(core.any(axis=(1, 2))):
        total[power][np.ix_(rows, columns)] += left[rows] @ core[power] @ right[columns].T


def as_drawn(machine: Machine) -> Model:
    """Return the nominal model ("as drawn"): its Parts are the springs and dampers of the MJCF."""
    return Model(machine, spring_parts(machine))
