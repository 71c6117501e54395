"""Part of a restoring law in the tests with equal hits.

The law acts on the lines of a test as the complex stiffness that it shows under a hit of that
test's level (``joint_transient``). It is simulated about one linear machine. All set-ups of one
level and hammer point have equal hits, and one Part, so that one evaluation answers them all.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from diagnosis.levels.law_table import LawTable
from identification.words import Complex, Condition, Real
from mbmodel import Addition, Change, Edit, Parameter, PartContext


@dataclass(frozen=True, eq=False)
class LawPart:
    """A law in tests with equal hits, as a complex stiffness of the joint direction.

    Args:
        location: joint.
        parameters: of the law, in the order of the family; relative duration, variance and peak of
            the hits.
        table: of all tests.
        number: of the first of these tests.
        conditions: of the tests.
        spring: joint of the direction.
    """

    location: str
    parameters: tuple[Parameter, ...]
    table: LawTable
    number: int
    conditions: frozenset[Condition]
    spring: str

    def acts(self, condition: Condition | None) -> float:
        """Return whether a test is one of the Part's own."""
        return float(condition in self.conditions)

    def changes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the stiffness at theta."""
        if not self.acts(context.condition):
            return ()
        middle, slopes = self.table.at(theta[:-1])
        values = middle[self.number] + np.log(theta[-1]) * slopes[-1, self.number]
        return (self._change(values, np.eye(3)[0, :, None, None]),)

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the derivatives of the stiffness by each parameter."""
        if not self.acts(context.condition):
            return ()
        derivatives = self.table.at(theta[:-1])[1][:, self.number].copy()
        derivatives[-1] /= theta[-1]
        cores = np.zeros((len(theta), len(theta), 3, 1, 1))
        cores[np.arange(len(theta)), np.arange(len(theta)), 0] = 1.0
        return tuple(self._change(row, core) for row, core in zip(derivatives, cores, strict=True))

    def write(self, theta: Real) -> tuple[Edit | Addition, ...]:
        """Return the law as elements of an MJCF; the Part of the first test writes it for all."""
        if self.number:
            return ()
        count = len(self.table.family.parameters)
        return self.table.family.write(self.spring, theta[:count])

    def select_held(self, theta: Real) -> Real:
        """Return theta: the MJCF holds the law."""
        return theta

    def _change(self, values: Complex, core: Real) -> Change:
        column = self.table.joint.direction[:, None]
        shape = partial(_look_up, self.table.joint.freq_hz, values)
        return Change("joint", column, column, core, shape=shape)


def _look_up(freq_hz: Real, values: Complex, laplace: Complex) -> Complex:
    """Return a table's values at the nearest lines; conjugate below the real axis."""
    wanted = np.abs(laplace.imag) / (2 * np.pi)
    after = np.clip(np.searchsorted(freq_hz, wanted), 1, max(len(freq_hz) - 1, 1))
    before = np.maximum(after - 1, 0)
    after = np.minimum(after, len(freq_hz) - 1)
    is_after = np.abs(freq_hz[after] - wanted) < np.abs(freq_hz[before] - wanted)
    nearest = values[np.where(is_after, after, before)]
    return np.where(laplace.imag < 0, nearest.conj(), nearest)
