"""Part for the gain of a force channel or drive: one factor for all tests that it drove.

A test reads H_measured = gain H in all its channels, whatever the place of the hit. With several
Parts of this kind in one test, their factors multiply.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.words import Condition, Real
from mbmodel.mjcf.edit import Edit, NotInMjcf
from mbmodel.parts.part import Change, Parameter, PartContext, ToleranceKind


@dataclass(frozen=True, eq=False)
class HammerGainPart:
    """Gain of one hammer or drive.

    Args:
        instrument: name of the hammer or drive, as ``Condition.instrument`` gives it.
        known: kind of the gain's prior.
    """

    instrument: str
    known: ToleranceKind

    @property
    def location(self) -> str:
        """Place in the test, ``hammer:<name>``."""
        return f"hammer:{self.instrument}"

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The gain."""
        return (Parameter(f"hammer({self.instrument}).gain", 1.0, "1", known=self.known),)

    def acts(self, condition: Condition | None) -> float:
        """Return 1 in the tests that this hammer or drive made, else 0."""
        return float(condition is not None and condition.instrument == self.instrument)

    def changes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the gain minus one."""
        return self._change(np.array([theta[0] - 1.0, 0.0, 0.0]), context)

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the derivative by the gain."""
        del theta
        return self._change(np.array([[1.0, 0.0, 0.0]]), context)

    def _change(self, coefficients: Real, context: PartContext) -> tuple[Change, ...]:
        """Return a change of the inputs' factor, if this hammer made the test."""
        if not self.acts(context.condition):
            return ()
        unit = np.ones((1, 1))
        return (Change("input", unit, unit, coefficients[..., None, None]),)

    def write(self, theta: Real) -> tuple[Edit | NotInMjcf, ...]:
        """Return that an MJCF does not hold the gain."""
        if theta[0] == 1:
            return ()
        return (NotInMjcf(self.parameters[0].name, "an MJCF describes no force channel"),)


def hammer_gain_parts(
    instruments: Iterable[str], known: ToleranceKind
) -> tuple[HammerGainPart, ...]:
    """Return one Part for each hammer or drive.

    Args:
        instruments: names of hammers and drives.
        known: kind of the gains' prior.
    """
    return tuple(HammerGainPart(instrument, known) for instrument in instruments)
