"""Parts for the mass, inertia and centre of mass of stages."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.words import Real
from mbmodel.linearisation.drawing import DrawnBody
from mbmodel.machine import Machine
from mbmodel.mjcf.edit import Edit, MjcfLack, NotInMjcf
from mbmodel.parts.part import AXIS_NAMES, Change, Parameter, PartContext, drawn_values
from mbmodel.spatial import cross_matrix, nearest_inertia, spatial_inertia, split_inertia

# Row and column of the six parameters of an inertia.
_INERTIA_ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
_MIN_REPORTED_INERTIA_CHANGE = 1e-5  # of the largest moment of inertia: less is rounding


@dataclass(frozen=True, eq=False)
class BodyPart:
    """A stage's mass m, inertia I and displacement d of its centre of mass, all in world axes.

        Mb += [[m 1, -m [d]x], [m [d]x, I + m (d.d 1 - d d')]] - (this matrix as drawn)

    about the drawn centre of mass. The motions that bear the body's label stay those of the drawn
    centre.

    Args:
        body: name of the stage.
        number: of the body in the machine.
        drawn_inertia: spatial inertia on the drawing, about its centre of mass; (6, 6).
        drawn_body: the MJCF body that is written.
        n_body: number of bodies of the machine.
    """

    body: str
    number: int
    drawn_inertia: Real
    drawn_body: DrawnBody
    n_body: int

    @property
    def location(self) -> str:
        """Place in the machine, ``body:<name>``."""
        return f"body:{self.body}"

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Mass, moments and products of inertia, displacement of the centre of mass."""
        inertia = self.drawn_inertia[3:, 3:]
        return (
            Parameter(f"{self.body}.mass", float(self.drawn_inertia[0, 0]), "kg", known="mass"),
            *(
                Parameter(
                    f"{self.body}.inertia_{AXIS_NAMES[i]}{AXIS_NAMES[j]}",
                    float(inertia[i, j]),
                    "kg m^2",
                    positive=i == j,
                    known="inertia",
                )
                for i, j in _INERTIA_ENTRIES
            ),
            *(
                Parameter(f"{self.body}.com_{axis}", 0.0, "m", positive=False, known="com")
                for axis in AXIS_NAMES
            ),
        )

    @cached_property
    def _frame(self) -> Real:
        """Selects the body's motion; (6 n_body, 6)."""
        frame = np.zeros((6 * self.n_body, 6))
        frame[6 * self.number : 6 * self.number + 6] = np.eye(6)
        return frame

    def _inertia(self, theta: Real) -> Real:
        """Return the spatial inertia at theta; (6, 6)."""
        inertia = np.zeros((3, 3))
        for (i, j), value in zip(_INERTIA_ENTRIES, theta[1:7], strict=True):
            inertia[i, j] = inertia[j, i] = value
        return spatial_inertia(float(theta[0]), theta[7:], inertia)

    def changes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the spatial inertia at theta minus that of the drawing, on s^2."""
        del context
        core = np.zeros((3, 6, 6))
        core[2] = self._inertia(theta) - self.drawn_inertia
        return (Change("body", self._frame, self._frame, core),)

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the derivatives of the spatial inertia."""
        del context
        mass, offset = float(theta[0]), theta[7:]
        core = np.zeros((10, 3, 6, 6))
        core[0, 2] = spatial_inertia(1.0, offset, np.zeros((3, 3)))
        for k, (i, j) in enumerate(_INERTIA_ENTRIES):
            core[1 + k, 2, 3 + i, 3 + j] = core[1 + k, 2, 3 + j, 3 + i] = 1.0
        arm = cross_matrix(offset)
        for k, unit in enumerate(np.eye(3)):
            turn = cross_matrix(unit)
            core[7 + k, 2, :3, 3:] = -mass * turn
            core[7 + k, 2, 3:, :3] = mass * turn
            core[7 + k, 2, 3:, 3:] = -mass * (turn @ arm + arm @ turn)
        return (Change("body", self._frame, self._frame, core),)

    def write(self, theta: Real, added_inertia: Real | None = None) -> tuple[Edit | NotInMjcf, ...]:
        """Return the <inertial> of the stage's own MJCF body, which takes the whole change.

        Measured motions may leave some moments of inertia undetermined, so that fitted ones may be
        physically impossible. Then the nearest possible ones are written, with a remark.

        Args:
            theta: values of the parameters; (10,).
            added_inertia: spatial inertia that other Parts add; (6, 6).
        """
        drawn = [parameter.drawn for parameter in self.parameters]
        if np.array_equal(theta, drawn) and added_inertia is None:
            return ()
        mass, offset, inertia = self._split_own(theta, added_inertia)
        if mass <= 0:
            return (NotInMjcf(f"{self.body}.mass", MjcfLack.MASS),)
        drawn_body, nearest = self.drawn_body, nearest_inertia(inertia)
        local = drawn_body.frame.T @ nearest @ drawn_body.frame
        values: dict[str, float | tuple[float, ...]] = {
            "pos": tuple(
                (drawn_body.frame.T @ (drawn_body.centre + offset - drawn_body.origin)).tolist()
            ),
            "mass": mass,
            "fullinertia": tuple(local[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist()),
        }
        edit = Edit("inertial", self.body, values)
        if np.abs(nearest - inertia).max() <= _MIN_REPORTED_INERTIA_CHANGE * np.abs(inertia).max():
            return (edit,)
        return (edit, NotInMjcf(f"{self.body}.inertia", MjcfLack.INERTIA))

    def select_held(self, theta: Real, added_inertia: Real | None = None) -> Real:
        """Return theta with the moments of inertia that are written.

        Args:
            theta (10,), added_inertia (6, 6): as for ``write``.
        """
        mass, _, inertia = self._split_own(theta, added_inertia)
        if mass <= 0:
            return drawn_values(self, theta)
        held, moved = theta.copy(), nearest_inertia(inertia) - inertia
        held[1:7] += [moved[i, j] for i, j in _INERTIA_ENTRIES]
        return held

    def _split_own(self, theta: Real, added_inertia: Real | None) -> tuple[float, Real, Real]:
        """Return mass, displacement of its centre and inertia of the MJCF body that is written."""
        total = self.drawn_body.inertia + self._inertia(theta) - self.drawn_inertia
        if added_inertia is not None:
            total = total + added_inertia
        if total[0, 0] <= 0:
            return 0.0, np.zeros(3), np.zeros((3, 3))
        return split_inertia(total)


def body_parts(machine: Machine) -> tuple[BodyPart, ...]:
    """Return one Part for each body that the drawing contains."""
    bodies = machine.layout.bodies
    return tuple(
        BodyPart(
            name,
            k,
            machine.body_mass[6 * k : 6 * k + 6, 6 * k : 6 * k + 6],
            machine.drawing.bodies[name],
            len(bodies),
        )
        for k, name in enumerate(bodies)
        if name in machine.drawing.bodies
    )
