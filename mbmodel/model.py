"""A model: a machine with its Parts, assembled to an equation of motion at given parameters."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate, pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from identification.words import Condition, Mask, Real, UsageError
from mbmodel.assembly import Assembly, Matrices, add_product, frequency_dependent_term
from mbmodel.control_loops.loop_part import LoopPart, loop_parts
from mbmodel.linearisation.gravity import gravity_slope, gravity_stiffness
from mbmodel.machine import Machine
from mbmodel.mjcf.edit import Addition, Edit, NotInMjcf
from mbmodel.moving_equilibrium.posed_model import model_at_rest, static_parameters
from mbmodel.moving_equilibrium.slopes import equilibrium_slopes
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
from mbmodel.variants.variant_parts import parts_in_variant

T = TypeVar("T", bound=np.generic)

# Selects the coefficient of s^2 among (3, n, n): a mass matrix as a polynomial in s.
_MASS_POWER = np.array([0.0, 0.0, 1.0])[:, None, None]


@dataclass(frozen=True, eq=False)
class Model:
    """A machine and the Parts that act on it.

    The vector theta lists the parameters of all Parts, Part by Part, in SI units.

    Control loops of the machine act beside the Parts: they are known, and have no parameters.

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

    @cached_property
    def loops(self) -> tuple[LoopPart, ...]:
        """Known Parts of the control loops that are closed around the machine."""
        return loop_parts(self.machine)

    def for_test(self, condition: Condition | None) -> "Model":
        """Return the model of a test: that of the machine's variant in which it was made.

        It has the same parameters. Without a variant it is the model itself.

        Args:
            condition: of the test, or None.
        """
        return self.in_variant("" if condition is None else condition.variant)

    def in_variant(self, name: str) -> "Model":
        """Return the model of a variant of the machine, with the same parameters.

        Args:
            name: of the variant; the model itself without one.
        """
        if not name or not self.machine.variants:
            return self
        if name not in self._variants:
            variant = self.machine.variants[name]
            self._variants[name] = Model(
                variant, parts_in_variant(self.machine, variant, self.parts)
            )
        return self._variants[name]

    @cached_property
    def _variants(self) -> dict[str, "Model"]:
        """Models of variants that tests have asked for, by name."""
        return {}

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
                machine.body_gravity, machine.precedence, jacobian, weight_bearing_mass
            )
        return total

    @cached_property
    def _rests(self) -> dict[bytes, "Model"]:
        """The model at its last static equilibrium, by the parameters that it depends on."""
        return {}

    @cached_property
    def _slopes_of_rest(
        self,
    ) -> dict[tuple[bytes, bytes, tuple[float, ...]], list[tuple[Change, ...]]]:
        """The last slopes through the equilibrium, by theta, chosen parameters and test."""
        return {}

    def at_rest(self, theta: Real) -> "Model":
        """Return the model at its static equilibrium at theta.

        It is the model itself if the equilibrium stays, or if nothing on which it depends differs
        from the nominal model.

        Args:
            theta: parameters in SI; (n_parameter,).

        Raises:
            ConvergenceError: the machine has no equilibrium at theta.
        """
        if self.machine.statics is None:
            return self
        values = static_parameters(self, theta)
        if np.array_equal(values, static_parameters(self, self.drawn)):
            return self
        key = values.tobytes()
        if key not in self._rests:
            self._rests.clear()
            self._rests[key] = model_at_rest(self, theta)
        return self._rests[key]

    def assemble(self, theta: Real, condition: Condition | None = None) -> Assembly:
        """Assemble T, M, C, K and the changes at sensors and hammer.

        Args:
            theta: parameters in SI; (n_parameter,).
            condition: of the test, for Parts that act in some tests only; None if no test is meant.

        Raises:
            ConvergenceError: a hung or preloaded machine has no equilibrium at theta.
        """
        posed = self.for_test(condition).at_rest(theta)
        if posed is not self:
            return posed.assemble(theta, condition)
        machine = self.machine
        context = PartContext(machine, condition)
        slots = "joint", "body", "path", "output", "point"
        by_slot: dict[str, list[Change]] = {slot: [] for slot in slots}
        frequency_dependent: list[tuple[Change, str]] = []
        input_changes: dict[int, list[Change]] = {}
        for loop in self.loops:
            frequency_dependent += [
                (change, loop.location) for change in loop.changes(np.zeros(0), context)
            ]
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
                replace(frequency_dependent_term(change, jacobian), owner=owner)
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
                    machine.body_gravity,
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
        edits += [not_held for loop in self.loops for not_held in loop.write(np.zeros(0))]
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
        model = self.for_test(condition)
        if model is not self:
            return model.slopes(theta, condition, chosen)
        posed = self.at_rest(theta)
        context = PartContext(posed.machine, condition)
        chosen_of_parts = self.split_parameters(
            np.ones(len(theta), bool) if chosen is None else chosen
        )
        slopes = [
            part.slopes(values, context) if mask.any() else ()
            for part, values, mask in zip(
                posed.parts, self.split_parameters(theta), chosen_of_parts, strict=True
            )
        ]
        if self.machine.statics is None:
            return slopes
        mask = np.concatenate(chosen_of_parts)
        key = theta.tobytes(), mask.tobytes(), self.acting_fractions(condition)
        if key not in self._slopes_of_rest:  # tests of one fit share theta
            self._slopes_of_rest.clear()
            self._slopes_of_rest[key] = equilibrium_slopes(self, theta, condition, chosen_of_parts)
        added = self._slopes_of_rest[key]
        return [(*fixed, *moved) for fixed, moved in zip(slopes, added, strict=True)]


def as_drawn(machine: Machine) -> Model:
    """Return the nominal model ("as drawn"): its Parts are the springs and dampers of the MJCF."""
    return Model(machine, spring_parts(machine))
