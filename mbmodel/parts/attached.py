r"""Part for an instrument that hangs on the machine in some tests: accelerometer, gauge, stinger.

A mass m at a point moves with it, and its force is not in the measured one:

    M += m R' R,   R the translations of the point per motion of the bodies.

So it is for accelerometers, and for what sits between a force gauge and the machine. A stinger, a
straight rod of length L and diameter d, ends at the gauge. Its axial force is measured. Sideways,
in bending and in torsion it holds the point with forces that nobody measures. The shaker holds its
other end, at p - L e, where e is the direction in which the reference pushes at p. With
I = pi d^4 / 64, motion u and rotation t of the point, the rod acts on it as a clamped beam does
(Euler and Bernoulli; Przemieniecki 1968, ch. 5.6):

    F = 12 E I / L^3 (1 - e e') u + 6 E I / L^2 e x t
    M = 4 E I / L (1 - e e') t - 6 E I / L^2 e x u + G J / L e e' t,   J = 2 I, G = E / 2.6.
"""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from identification.words import Condition, Dof, Real
from mbmodel.mjcf.edit import MjcfLack, NotInMjcf
from mbmodel.parts.part import Change, Parameter, PartContext
from mbmodel.spatial import cross_matrix

_SHEAR = 2.6  # 2 (1 + nu) of steel, brass and nylon alike


@dataclass(frozen=True)
class Stinger:
    """A straight rod between shaker and force gauge.

    Args:
        diameter: d [m].
        length: L between its clamped ends [m].
        modulus: E [Pa].
    """

    diameter: float
    length: float
    modulus: float = 2.1e11

    def stiffness(self, direction: Real) -> Real:
        """Return the stiffness at the gauge's end, without that along the rod.

        Args:
            direction: e, in which the shaker pushes; (3,).

        Returns:
            Force and moment per motion and rotation of the point; (6, 6).
        """
        bending, length = self.modulus * np.pi * self.diameter**4 / 64, self.length
        along = np.outer(direction, direction)
        aside, cross = np.eye(3) - along, cross_matrix(direction)
        result = np.zeros((6, 6))
        result[:3, :3] = 12 * bending / length**3 * aside
        result[:3, 3:] = 6 * bending / length**2 * cross
        result[3:, :3] = result[:3, 3:].T
        result[3:, 3:] = 4 * bending / length * aside
        result[3:, 3:] += 2 * bending / _SHEAR / length * along
        return result


@dataclass(frozen=True, eq=False)
class AttachedPart:
    """An instrument at a point in the tests of some files.

    Args:
        instrument: ``sensor:<site>`` or ``hammer:<name>``.
        pushes: the reference that it drives; of a sensor any direction of its point.
        files: names of the files in whose tests it hangs on the machine; None for always.
        mass: m [kg].
        stinger: what holds it; None for nothing.
    """

    instrument: str
    pushes: Dof
    files: Collection[str] | None
    mass: float
    stinger: Stinger | None = None

    @property
    def location(self) -> str:
        """Place in the test."""
        return self.instrument

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The mass."""
        name = f"{self.instrument.partition(':')[2]}.attached_mass({self.pushes})"
        return (Parameter(name, self.mass, "kg", positive=False, known="exactly"),)

    def acts(self, condition: Condition | None) -> float:
        """Return 1 in the tests of its files, else 0."""
        if self.files is None:
            return 1.0
        return float(condition is not None and condition.test in self.files)

    def changes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return mass and stiffness at the point, if it hangs there."""
        core = np.zeros((3, 6, 6))
        core[2, :3, :3] = theta[0] * np.eye(3)
        if self.stinger is not None:
            core[0] = self.stinger.stiffness(np.eye(3)[self.pushes.axis % 3] * self.pushes.sign)
        return self._change(core, context)

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the derivative by the mass."""
        del theta
        core = np.zeros((1, 3, 6, 6))
        core[0, 2, :3, :3] = np.eye(3)
        return self._change(core, context)

    def _change(self, core: Real, context: PartContext) -> tuple[Change, ...]:
        if not self.acts(context.condition):
            return ()
        point = context.machine.layout.rows([Dof.of(self.pushes.point, axis) for axis in range(6)])
        return (Change("body", point.T, point.T, core),)

    def write(self, theta: Real) -> tuple[NotInMjcf, ...]:
        """Return nothing for the stated mass: an MJCF is that of the machine alone."""
        if theta[0] == self.mass:
            return ()
        return (NotInMjcf(self.parameters[0].name, MjcfLack.SOME_TESTS),)

    def select_held(self, theta: Real) -> Real:
        """Return theta: apart from tests it is nowhere."""
        return theta
