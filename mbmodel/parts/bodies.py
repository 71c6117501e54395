"""Mass, inertia and centre of mass of a stage."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.words import Real
from mbmodel.linearisation.drawing import Heavy
from mbmodel.machine import Machine
from mbmodel.mjcf.edit import Edit, NotHeld
from mbmodel.parts.part import Change, Parameter, Situation
from mbmodel.spatial import cross_matrix, nearest_inertia, spatial_inertia, split_inertia

_AXES = "xyz"
_ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
_SLIGHT = 1e-5  # of a moment of inertia: less is no change

_NEAREST = "no body has such moments of inertia: written are the nearest that one can have"


@dataclass(frozen=True, eq=False)
class BodyPart:
    """A stage's mass m, inertia I and centre of mass, displaced by d, all in world axes.

        Mb += [[m 1, -m [d]x], [m [d]x, I + m (d.d 1 - d d')]] - the same as drawn

    about the drawn centre of mass. Motions of the body's label stay those of the drawn centre.

    Args:
        body: name of the stage.
        number: of the body in the machine.
        drawn: its spatial inertia on the drawing, about its centre of mass; (6, 6).
        heavy: the MJCF body that is written.
        n_body: bodies of the machine.
    """

    body: str
    number: int
    drawn: Real
    heavy: Heavy
    n_body: int

    @property
    def location(self) -> str:
        """``body:<name>``."""
        return f"body:{self.body}"

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Mass, moments and products of inertia, displacement of the centre."""
        inertia = self.drawn[3:, 3:]
        return (
            Parameter(f"{self.body}.mass", float(self.drawn[0, 0]), "kg", known="mass"),
            *(
                Parameter(
                    f"{self.body}.inertia_{_AXES[i]}{_AXES[j]}",
                    float(inertia[i, j]),
                    "kg m^2",
                    positive=i == j,
                    known="inertia",
                )
                for i, j in _ENTRIES
            ),
            *(
                Parameter(f"{self.body}.com_{axis}", 0.0, "m", positive=False, known="com")
                for axis in _AXES
            ),
        )

    @cached_property
    def _frame(self) -> Real:
        frame = np.zeros((6 * self.n_body, 6))
        frame[6 * self.number : 6 * self.number + 6] = np.eye(6)
        return frame

    def _inertia(self, theta: Real) -> Real:
        inertia = np.zeros((3, 3))
        for (i, j), value in zip(_ENTRIES, theta[1:7], strict=True):
            inertia[i, j] = inertia[j, i] = value
        return spatial_inertia(float(theta[0]), theta[7:], inertia)

    def changes(self, theta: Real, situation: Situation) -> tuple[Change, ...]:
        """Spatial inertia at theta less that of the drawing, on s^2."""
        del situation
        core = np.zeros((3, 6, 6))
        core[2] = self._inertia(theta) - self.drawn
        return (Change("body", self._frame, self._frame, core),)

    def slopes(self, theta: Real, situation: Situation) -> tuple[Change, ...]:
        """Derivatives of the spatial inertia."""
        del situation
        mass, offset = float(theta[0]), theta[7:]
        core = np.zeros((10, 3, 6, 6))
        core[0, 2] = spatial_inertia(1.0, offset, np.zeros((3, 3)))
        for k, (i, j) in enumerate(_ENTRIES):
            core[1 + k, 2, 3 + i, 3 + j] = core[1 + k, 2, 3 + j, 3 + i] = 1.0
        arm = cross_matrix(offset)
        for k, unit in enumerate(np.eye(3)):
            turn = cross_matrix(unit)
            core[7 + k, 2, :3, 3:] = -mass * turn
            core[7 + k, 2, 3:, :3] = mass * turn
            core[7 + k, 2, 3:, 3:] = -mass * (turn @ arm + arm @ turn)
        return (Change("body", self._frame, self._frame, core),)

    def write(self, theta: Real, more: Real | None = None) -> tuple[Edit | NotHeld, ...]:
        """The <inertial> of the stage's own MJCF body, which takes the whole change.

        A fit knows of moments of inertia what its motions show, and of the rest may ask for what
        no body has: then the nearest are written, and said.

        Args:
            theta: as of the other methods.
            more: spatial inertia that something else adds; (6, 6).
        """
        drawn = [parameter.drawn for parameter in self.parameters]
        if np.array_equal(theta, drawn) and more is None:
            return ()
        heavy = self.heavy
        total = heavy.inertia + self._inertia(theta) - self.drawn
        if more is not None:
            total = total + more
        if total[0, 0] <= 0:
            return (NotHeld(f"{self.body}.mass", "its own MJCF body would weigh nothing"),)
        mass, offset, inertia = split_inertia(total)
        nearest = nearest_inertia(inertia)
        local = heavy.frame.T @ nearest @ heavy.frame
        values: dict[str, float | tuple[float, ...]] = {
            "pos": tuple((heavy.frame.T @ (heavy.centre + offset - heavy.origin)).tolist()),
            "mass": mass,
            "fullinertia": tuple(local[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist()),
        }
        written = Edit("inertial", self.body, values)
        if np.abs(nearest - inertia).max() <= _SLIGHT * np.abs(inertia).max():
            return (written,)
        return (written, NotHeld(f"{self.body}.inertia", _NEAREST))


def body_parts(machine: Machine) -> tuple[BodyPart, ...]:
    """One Part for each body that the drawing knows."""
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
