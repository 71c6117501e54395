"""A machine with its Parts at one pose, assembled to an equation of motion at given parameters."""

from collections import Counter
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate, pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from identification.words import Condition, Real, UsageError
from mbmodel.assembly import (
    Assembly,
    Matrices,
    add_product,
    frequency_dependent_term,
    kinematics_and_coefficients,
    nominal_coefficients,
)
from mbmodel.control_loops.loop_part import LoopPart, loop_parts
from mbmodel.machine import Machine
from mbmodel.parts import Change, ConditionalPart, Parameter, Part, PartContext
from mbmodel.ports.rest_change import REST, rest_changes

T = TypeVar("T", bound=np.generic)

_SLOTS = "joint", "body", "path", "output", "point"


@dataclass(frozen=True, eq=False)
class PosedModel:
    """A machine and the Parts that act on it, at the pose of the machine.

    The vector theta lists the parameters of all Parts, Part by Part, in SI units.

    Control loops of the machine act beside the Parts, without parameters, and so does what was
    measured to lack in the state before a change.

    Args:
        machine: at its static equilibrium, or at another pose.
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
        return nominal_coefficients(self.machine, self.machine.jacobian)

    def assemble(self, theta: Real, condition: Condition | None = None) -> Assembly:
        """Assemble T, M, C, K and the changes at sensors and hammer at this pose.

        Args:
            theta: parameters in SI; (n_parameter,).
            condition: of the test, for Parts that act in some tests only; None if no test is meant.
        """
        context = PartContext(self.machine, condition)
        by_slot: dict[str, list[Change]] = {slot: [] for slot in _SLOTS}
        input_changes: dict[int, list[Change]] = {}
        frequency_dependent = [
            (change, loop.location)
            for loop in self.loops
            for change in loop.changes(np.zeros(0), context)
        ]
        frequency_dependent += [(change, REST) for change in rest_changes(self.machine)]
        for number, values in enumerate(self.split_parameters(theta)):
            for change in self.parts[number].changes(values, context):
                if change.slot == "input":
                    input_changes.setdefault(number, []).append(change)
                elif change.shape is not None and change.slot != "output":
                    names = [parameter.name for parameter in self.parts[number].parameters]
                    owner = change.owner or [*names, self.parts[number].location][0]
                    frequency_dependent += [(change, owner)] if change.core.any() else []
                else:
                    by_slot[change.slot if change.slot in by_slot else "point"].append(change)
        jacobian, total = kinematics_and_coefficients(
            self.machine, lambda: self._coefficients_as_drawn, by_slot["path"], by_slot["body"]
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
