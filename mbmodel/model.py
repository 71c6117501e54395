"""A model: a machine with its Parts, assembled to an equation of motion at given parameters."""

from collections import Counter
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate, pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from identification.words import Condition, Integers, Mask, Real, UsageError
from mbmodel.assembly import Assembly, Matrices, add_product, frequency_dependent_term
from mbmodel.coefficients import kinematics_and_coefficients, nominal_coefficients
from mbmodel.control_loops.loop_part import LoopPart, loop_parts
from mbmodel.machine import Machine
from mbmodel.mjcf.edit import Addition, Edit, NotInMjcf
from mbmodel.moving_equilibrium.kept_equilibria import KeptEquilibria
from mbmodel.parts import (
    AddedPart,
    Change,
    ConditionalPart,
    Parameter,
    Part,
    PartContext,
    spring_parts,
)
from mbmodel.variants.variant_parts import parts_in_variant
from mbmodel.writing.model_edits import held_parameters, model_edits

T = TypeVar("T", bound=np.generic)

_SLOTS = "joint", "body", "path", "output", "point"


@dataclass(frozen=True, eq=False)
class Model:
    """A machine and the Parts that act on it.

    The vector theta lists the parameters of all Parts, Part by Part, in SI units.

    Control loops of the machine act beside the Parts, without parameters.

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

        It has the same parameters; without a variant it is the model itself.
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
    def _part_numbers(self) -> Integers:
        """Number of the Part of each parameter; (n_parameter,)."""
        return np.repeat(np.arange(len(self.parts)), [len(part.parameters) for part in self.parts])

    @cached_property
    def _conditional(self) -> tuple[ConditionalPart, ...]:
        """Parts that act in some tests only."""
        return tuple(part for part in self.parts if isinstance(part, ConditionalPart))

    @cached_property
    def _coefficients_as_drawn(self) -> Real:
        """Coefficients of s^0, s^1, s^2 without any Part; (3, nv, nv)."""
        return nominal_coefficients(self.machine, self.machine.jacobian)

    @cached_property
    def _kept_equilibria(self) -> KeptEquilibria:
        """Last equilibria, and slopes through them."""
        return KeptEquilibria(self)

    def at_rest(self, theta: Real) -> "Model":
        """Return the model at its static equilibrium; itself if the equilibrium stays.

        Args:
            theta: parameters in SI; (n_parameter,).

        Raises:
            ConvergenceError: the machine has no equilibrium at theta.
        """
        if self.machine.statics is None:
            return self
        return self._kept_equilibria.at_rest(theta)

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
        context = PartContext(self.machine, condition)
        by_slot: dict[str, list[Change]] = {slot: [] for slot in _SLOTS}
        input_changes: dict[int, list[Change]] = {}
        frequency_dependent = [
            (change, loop.location)
            for loop in self.loops
            for change in loop.changes(np.zeros(0), context)
        ]
        for number, values in enumerate(self.split_parameters(theta)):
            for change in self.parts[number].changes(values, context):
                if change.slot == "input":
                    input_changes.setdefault(number, []).append(change)
                elif change.shape is not None and change.slot != "output":
                    names = [parameter.name for parameter in self.parts[number].parameters]
                    owner = [*names, self.parts[number].location][0]
                    frequency_dependent += [(change, owner)] if change.core.any() else []
                else:
                    by_slot[change.slot if change.slot in by_slot else "point"].append(change)
        jacobian, total = kinematics_and_coefficients(
            self.machine, self._coefficients_as_drawn, by_slot["path"], by_slot["body"]
        )
        for change in by_slot["joint"]:
            add_product(total, change.left, change.core, change.right)
        stiffness, damping, mass = total
        return Assembly(
            self.machine,
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
        return model_edits(self, theta)

    def without_small_sizes(self, theta: Real) -> Real:
        """Return the parameters without sizes of added Parts that count as nothing.

        Args:
            theta: parameters in SI; (n_parameter,).
        """
        values = zip(self.parts, self.split_parameters(theta), strict=True)
        stated = [
            part.leave_out(value) if isinstance(part, AddedPart) and part.leave_out else value
            for part, value in values
        ]
        return np.concatenate([*stated, np.zeros(0)])

    def select_held(self, theta: Real) -> Real:
        """Return the parameters that the MJCF holds once theta is written; (n_parameter,).

        Args:
            theta: parameters in SI; (n_parameter,).
        """
        return held_parameters(self, theta)

    def slopes(
        self, theta: Real, condition: Condition | None = None, chosen: Mask | None = None
    ) -> list[tuple[Change, ...]]:
        """Return the exact derivatives of every Part's change, in the order of the Parts.

        Args:
            theta: parameters in SI; (n_parameter,).
            condition: of the test, or None.
            chosen: parameters of interest, all if None; (n_parameter,).
        """
        model = self.for_test(condition)
        if model is not self:
            return model.slopes(theta, condition, chosen)
        posed = self.at_rest(theta)
        context = PartContext(posed.machine, condition)
        wanted = np.ones(len(theta), bool) if chosen is None else chosen
        of_parts = self.split_parameters(theta)
        slopes: list[tuple[Change, ...]] = [()] * len(of_parts)
        for number in np.unique(self._part_numbers[wanted]).tolist():
            slopes[number] = posed.parts[number].slopes(of_parts[number], context)
        if self.machine.statics is None:
            return slopes
        added = self._kept_equilibria.slopes(theta, condition, wanted)
        return [(*fixed, *moved) for fixed, moved in zip(slopes, added, strict=True)]


def as_drawn(machine: Machine) -> Model:
    """Return the nominal model ("as drawn"): its Parts are the springs and dampers of the MJCF."""
    return Model(machine, spring_parts(machine))
