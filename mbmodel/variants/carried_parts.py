"""Parts of a nominal machine as they act in a variant of it, with the same parameters."""

from dataclasses import dataclass, replace

import numpy as np

from identification.words import Condition, Real
from mbmodel.mjcf.edit import Addition, Edit, NotInMjcf
from mbmodel.parts import Change, ConditionalPart, JointPart, Parameter, Part, PartContext


@dataclass(frozen=True, eq=False)
class CarriedPart:
    """A Part that is carried along with the bodies of a variant.

    Args:
        part: of the nominal machine.
        nominal: context of that machine, apart from any test.
        to_nominal: A, motion of the nominal reference points by that of the variant's bodies;
            (6 n_body, 6 n_body).
    """

    part: Part
    nominal: PartContext
    to_nominal: Real

    @property
    def location(self) -> str:
        """Place in the machine."""
        return self.part.location

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters, those of the nominal machine."""
        return self.part.parameters

    def acts(self, condition: Condition | None) -> float:
        """Return the fraction of the Part that acts in a test."""
        return self.part.acts(condition) if isinstance(self.part, ConditionalPart) else 1.0

    def changes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the finite change at theta."""
        return self._carry(self.part.changes(theta, self._at(context)))

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the derivative of the change by each parameter."""
        return self._carry(self.part.slopes(theta, self._at(context)))

    def write(self, theta: Real) -> tuple[Edit | Addition | NotInMjcf, ...]:
        """Return nothing: the nominal machine is written."""
        del theta
        return ()

    def select_held(self, theta: Real) -> Real:
        """Return theta, which the Part of the nominal machine writes."""
        return theta

    def _at(self, context: PartContext) -> PartContext:
        """Return the nominal machine in the test of a context."""
        return replace(self.nominal, condition=context.condition)

    def _carry(self, changes: tuple[Change, ...]) -> tuple[Change, ...]:
        """Return changes at the bodies of the variant."""
        return tuple(self._carry_change(change) for change in changes)

    def _carry_change(self, change: Change) -> Change:
        transposed = self.to_nominal.T
        if change.slot == "body":
            return replace(change, left=transposed @ change.left, right=transposed @ change.right)
        if change.slot in ("sensor", "hammer"):
            return replace(change, right=transposed @ change.right)
        if change.slot == "path":
            columns = np.asarray(np.linalg.solve(self.to_nominal, change.left), np.float64)
            return replace(change, left=columns)
        return change


@dataclass(frozen=True, eq=False)
class TurnedJointPart:
    """The joints of a stage whose parent is turned in a variant: vectors turn with the parent.

    Args:
        part: of the variant, in world axes.
        nominal: of the nominal machine, whose parameters it has.
        turn: rotation of the parent from the nominal machine to the variant; (3, 3).
    """

    part: JointPart
    nominal: JointPart
    turn: Real

    @property
    def location(self) -> str:
        """Place in the machine."""
        return self.nominal.location

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters, those of the nominal machine."""
        return self.nominal.parameters

    @property
    def _map(self) -> Real:
        """Parameters of the variant by those of the nominal machine; (n, n)."""
        return np.asarray(np.kron(np.eye(len(self.parameters) // 3), self.turn), np.float64)

    def changes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the finite change at theta."""
        return self.part.changes(self._map @ theta, context)

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the derivative of the change by each parameter."""
        turned = self.part.slopes(self._map @ theta, context)
        return tuple(
            replace(change, core=np.tensordot(self._map.T, change.core, 1)) for change in turned
        )

    def write(self, theta: Real) -> tuple[Edit | Addition | NotInMjcf, ...]:
        """Return nothing: the nominal machine is written."""
        del theta
        return ()

    def select_held(self, theta: Real) -> Real:
        """Return theta, which the Part of the nominal machine writes."""
        return theta
