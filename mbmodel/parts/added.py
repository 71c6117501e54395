"""Part for dynamics that the nominal model lacks; it changes nothing at its nominal parameters."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from identification.words import Condition, Real
from mbmodel.machine import Machine, Pose
from mbmodel.mjcf.edit import Addition, Edit, MjcfLack, NotInMjcf
from mbmodel.parts.part import Change, Parameter, PartContext, drawn_values
from mbmodel.spatial import transport

Changes = Callable[[Real], tuple[Change, ...]]


@dataclass(frozen=True, eq=False)
class AddedPart:
    """Part of dynamics that the nominal model lacks, such as an appendage or a bypass.

    Args:
        location: ``joint:<child body>``, ``body:<name>``, ``pair:<lower>-<upper>`` ...
        parameters: those that scale the change have the nominal value zero, so that the Part
            changes nothing in the nominal model.
        finite: returns the change at theta.
        derivatives: returns its derivatives by each parameter; cores (n_parameter, 3, r, t).
        when: returns the fraction of it that acts in a test, 0 to 1; None if all of it acts in
            every test.
        written: returns what to add to or edit in an MJCF at theta; None if no MJCF can hold it.
        weighs: returns the spatial inertia that it adds to its body at theta, (6, 6); None if it
            adds no mass.
        leave_out: returns theta without sizes that a statement of the change leaves out, since they
            count as nothing; None if there are none.
        goes_with: body along with which a change between bodies moves where the machine rests
            elsewhere than in the nominal model; each of them by its share if empty.
    """

    location: str
    parameters: tuple[Parameter, ...]
    finite: Changes
    derivatives: Changes
    when: Callable[[Condition], float] | None = None
    written: Callable[[Real], tuple[Edit | Addition | NotInMjcf, ...]] | None = None
    weighs: Callable[[Real], Real] | None = None
    leave_out: Callable[[Real], Real] | None = None
    goes_with: str = ""

    @classmethod
    def linear(
        cls,
        location: str,
        parameters: tuple[Parameter, ...],
        slopes: tuple[Change, ...],
        when: Callable[[Condition], float] | None = None,
    ) -> Self:
        """Build a Part that is linear in its parameters: theta_1 slope_1 + theta_2 slope_2 + ...

        Args:
            location: place in the machine, as in the class.
            parameters: one for each entry of the slopes' first axis.
            slopes: constant derivatives; cores (n_parameter, 3, r, t).
            when: fraction that acts in a test, as in the class.
        """

        def finite(theta: Real) -> tuple[Change, ...]:
            return tuple(
                replace(change, core=np.tensordot(theta, change.core, 1)) for change in slopes
            )

        return cls(location, parameters, finite, lambda _: slopes, when)

    def acts(self, condition: Condition | None) -> float:
        """Return the fraction of it that acts in a test.

        A Part with ``when`` does not act if no test is meant.
        """
        if self.when is None:
            return 1.0
        return 0.0 if condition is None else float(self.when(condition))

    def changes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the finite change at theta; empty if theta is zero or nothing acts."""
        fraction = self.acts(context.condition)
        if not (theta.any() and fraction):
            return ()
        acting = (change for change in self.finite(theta) if change.core.any())
        return self._act(fraction, acting, context.machine)

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the derivatives at theta; empty if nothing acts."""
        fraction = self.acts(context.condition)
        return self._act(fraction, self.derivatives(theta), context.machine) if fraction else ()

    def _act(
        self, fraction: float, changes: Iterable[Change], machine: Machine
    ) -> tuple[Change, ...]:
        """Return changes times the fraction that acts, at the pose of the machine."""
        scaled = (
            change if fraction == 1.0 else replace(change, core=fraction * change.core)
            for change in changes
        )
        if not self.goes_with or machine.pose is None:
            return tuple(scaled)
        carried = _carry(machine, machine.pose, machine.layout.bodies.index(self.goes_with))
        return tuple(
            replace(change, left=carried @ change.left, right=carried @ change.right)
            if change.slot == "body"
            else change
            for change in scaled
        )

    def write(self, theta: Real) -> tuple[Edit | Addition | NotInMjcf, ...]:
        """Return elements that hold it, beside additional mass, which is written with its body."""
        changed = [
            parameter.name
            for parameter, value in zip(self.parameters, theta, strict=True)
            if value != parameter.drawn
        ]
        if not changed:
            return ()
        if self.written is not None:
            return self.written(theta)
        if self.weighs is not None:
            return ()
        return tuple(NotInMjcf(name, self._reason(theta)) for name in changed)

    def select_held(self, theta: Real) -> Real:
        """Return theta if the MJCF holds all of it, else the nominal values."""
        is_whole = not any(isinstance(change, NotInMjcf) for change in self.write(theta))
        return theta if is_whole else drawn_values(self, theta)

    def _reason(self, theta: Real) -> MjcfLack:
        """Return why an MJCF cannot hold the change."""
        if self.when is not None:
            return MjcfLack.SOME_TESTS
        if any(change.shape is not None for change in self.finite(theta)):
            return MjcfLack.FREQUENCY
        return MjcfLack.OTHER_PACKAGE


def _carry(machine: Machine, pose: Pose, first: int) -> Real:
    """Return X' for the rows of bodies in a change that goes along with one of them.

    It acts on the motion of another body at the place where the first would carry its centre,

        v_P = R_1' (v + w x (P - c')),   w_P = R_1' w,   P = c_1' + R_1 (c - c_1),

    with v and w in world axes and R_1 the turn of the first from the nominal rest.

    Args:
        first: number of the body.

    Returns:
        (6 n_body, 6 n_body), the unit matrix for the first body.
    """
    centres = machine.layout.centres
    carried = np.zeros((6 * len(centres),) * 2)
    back = np.kron(np.eye(2), pose.turns[first].T)
    for number, centre in enumerate(centres):
        there = pose.centres[first] + pose.turns[first] @ (centre - centres[first])
        turn = np.kron(np.eye(2), pose.turns[number])
        block = slice(6 * number, 6 * number + 6)
        carried[block, block] = (back @ transport(there - pose.centres[number]) @ turn).T
    return carried
