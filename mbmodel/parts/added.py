"""A Part that is nothing on the drawing: what a machine may lack."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from identification.words import Condition, Real
from mbmodel.mjcf.edit import Addition, Edit, NotHeld
from mbmodel.parts.part import Change, Parameter, Situation

Changes = Callable[[Real], tuple[Change, ...]]


@dataclass(frozen=True, eq=False)
class AddedPart:
    """An appendage, a bypass, a joint's coupling: any change by parameters of its own.

    Args:
        location: ``joint:<child body>``, ``body:<name>``, ``pair:<lower>-<upper>`` ...
        parameters: those of size are drawn as zero, so that it changes nothing.
        finite: the change at theta.
        derivatives: of it by each parameter; cores (n_parameter, 3, r, t).
        when: how much of it acts in a test, 0 to 1; all of it in every test if None.
        written: what an MJCF gets for it at theta; None if no MJCF holds it.
        weighs: spatial inertia that its body has more at theta, (6, 6); None of what is no mass.
    """

    location: str
    parameters: tuple[Parameter, ...]
    finite: Changes
    derivatives: Changes
    when: Callable[[Condition], float] | None = None
    written: Callable[[Real], tuple[Addition | NotHeld, ...]] | None = None
    weighs: Callable[[Real], Real] | None = None

    @classmethod
    def linear(
        cls,
        location: str,
        parameters: tuple[Parameter, ...],
        slopes: tuple[Change, ...],
        when: Callable[[Condition], float] | None = None,
    ) -> Self:
        """theta_1 slope_1 + theta_2 slope_2 + .."""

        def finite(theta: Real) -> tuple[Change, ...]:
            return tuple(replace(one, core=np.tensordot(theta, one.core, 1)) for one in slopes)

        return cls(location, parameters, finite, lambda _: slopes, when)

    def acts(self, condition: Condition | None) -> float:
        """How much of it acts in a test; what acts in some tests only acts in none without any."""
        if self.when is None:
            return 1.0
        return 0.0 if condition is None else float(self.when(condition))

    def changes(self, theta: Real, situation: Situation) -> tuple[Change, ...]:
        """Nothing where all that is of it is zero."""
        part = self.acts(situation.condition)
        if not (theta.any() and part):
            return ()
        return _parts(part, (one for one in self.finite(theta) if one.core.any()))

    def slopes(self, theta: Real, situation: Situation) -> tuple[Change, ...]:
        """Derivatives at theta."""
        part = self.acts(situation.condition)
        return _parts(part, self.derivatives(theta)) if part else ()

    def write(self, theta: Real) -> tuple[Edit | Addition | NotHeld, ...]:
        """Elements that hold it; what is weighed is written with its body."""
        moved = [
            parameter.name
            for parameter, value in zip(self.parameters, theta, strict=True)
            if value != parameter.drawn
        ]
        if not moved or self.weighs is not None:
            return ()
        if self.written is not None:
            return self.written(theta)
        return tuple(NotHeld(name, self._why(theta)) for name in moved)

    def _why(self, theta: Real) -> str:
        if self.when is not None:
            return "it acts in some tests only"
        if any(one.shape is not None for one in self.finite(theta)):
            return "it depends on frequency as no element of an MJCF does"
        return "it is no element of an MJCF"


def _parts(part: float, changes: Iterable[Change]) -> tuple[Change, ...]:
    """So much of changes."""
    if part == 1.0:
        return tuple(changes)
    return tuple(replace(one, core=part * one.core) for one in changes)
