"""A Part that is nothing on the drawing: what a machine may lack."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from identification.words import Condition, Real
from mbmodel.edit import Edit, NotHeld
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
        when: in which tests it acts; in all if None.
    """

    location: str
    parameters: tuple[Parameter, ...]
    finite: Changes
    derivatives: Changes
    when: Callable[[Condition], bool] | None = None

    @classmethod
    def linear(
        cls,
        location: str,
        parameters: tuple[Parameter, ...],
        slopes: tuple[Change, ...],
        when: Callable[[Condition], bool] | None = None,
    ) -> Self:
        """theta_1 slope_1 + theta_2 slope_2 + .."""

        def finite(theta: Real) -> tuple[Change, ...]:
            return tuple(replace(one, core=np.tensordot(theta, one.core, 1)) for one in slopes)

        return cls(location, parameters, finite, lambda _: slopes, when)

    def acts(self, condition: Condition | None) -> bool:
        """Whether it acts in a test; what acts in some tests only acts in none without any."""
        return self.when is None or (condition is not None and self.when(condition))

    def changes(self, theta: Real, situation: Situation) -> tuple[Change, ...]:
        """Nothing where all that is of it is zero."""
        if not (theta.any() and self.acts(situation.condition)):
            return ()
        return tuple(one for one in self.finite(theta) if one.core.any())

    def slopes(self, theta: Real, situation: Situation) -> tuple[Change, ...]:
        """Derivatives at theta."""
        return self.derivatives(theta) if self.acts(situation.condition) else ()

    def write(self, theta: Real) -> tuple[Edit | NotHeld, ...]:
        """No MJCF element holds it as it stands."""
        return tuple(
            NotHeld(parameter.name, "it is no element of an MJCF")
            for parameter, value in zip(self.parameters, theta, strict=True)
            if value != parameter.drawn
        )
