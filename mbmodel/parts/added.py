"""A Part that is linear in its parameters and nothing on the drawing: what a machine may lack."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from identification.words import Condition, Real
from mbmodel.edit import Edit, NotHeld
from mbmodel.parts.part import Change, Parameter, Situation


@dataclass(frozen=True, eq=False)
class AddedPart:
    """theta_1 slope_1 + theta_2 slope_2 + ..: an appendage's mass, a bypass's stiffness.

    Args:
        location: ``joint:<child body>``, ``body:<name>``, ``pair:<lower>-<upper>`` ...
        parameters: drawn as zero.
        slopes_: derivatives by them; cores (n_parameter, 3, r, t).
        when: in which tests it acts; in all if None.
    """

    location: str
    parameters: tuple[Parameter, ...]
    slopes_: tuple[Change, ...]
    when: Callable[[Condition], bool] | None = None

    def acts(self, condition: Condition | None) -> bool:
        """Whether it acts in a test; what acts in some tests only acts in none without any."""
        return self.when is None or (condition is not None and self.when(condition))

    def changes(self, theta: Real, situation: Situation) -> tuple[Change, ...]:
        """Nothing at zero."""
        if not (theta.any() and self.acts(situation.condition)):
            return ()
        return tuple(
            replace(slope, core=np.tensordot(theta, slope.core, 1)) for slope in self.slopes_
        )

    def slopes(self, theta: Real, situation: Situation) -> tuple[Change, ...]:
        """The same everywhere."""
        del theta
        return self.slopes_ if self.acts(situation.condition) else ()

    def write(self, theta: Real) -> tuple[Edit | NotHeld, ...]:
        """No MJCF element holds it as it stands."""
        return tuple(
            NotHeld(parameter.name, "it is no element of an MJCF")
            for parameter, value in zip(self.parameters, theta, strict=True)
            if value
        )
