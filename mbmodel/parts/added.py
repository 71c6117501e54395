"""Part for dynamics that the nominal model lacks; it changes nothing at its nominal parameters."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from identification.words import Condition, Real
from mbmodel.mjcf.edit import Addition, Edit, MjcfLack, NotInMjcf
from mbmodel.parts.part import Change, Parameter, PartContext, drawn_values

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
    """

    location: str
    parameters: tuple[Parameter, ...]
    finite: Changes
    derivatives: Changes
    when: Callable[[Condition], float] | None = None
    written: Callable[[Real], tuple[Edit | Addition | NotInMjcf, ...]] | None = None
    weighs: Callable[[Real], Real] | None = None
    leave_out: Callable[[Real], Real] | None = None

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
        return _scaled_changes(
            fraction, (change for change in self.finite(theta) if change.core.any())
        )

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the derivatives at theta; empty if nothing acts."""
        fraction = self.acts(context.condition)
        return _scaled_changes(fraction, self.derivatives(theta)) if fraction else ()

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


def _scaled_changes(fraction: float, changes: Iterable[Change]) -> tuple[Change, ...]:
    """Return changes times the fraction that acts."""
    if fraction == 1.0:
        return tuple(changes)
    return tuple(replace(change, core=fraction * change.core) for change in changes)
