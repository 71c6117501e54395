"""What is off at a sensor or at the hammer: gain, angle, position.

The row of a point's direction k reads a_k.(v + w x r), the column of a hammer direction pushes
likewise: both are [a_k, r x a_k] for the axis a_k at r from the body's centre (seed, eq. 2.2 to
2.4). With gains g, true axes = R(rotation) times the drawn ones, true place = drawn + offset, both
vectors in world axes, a row becomes g_k [R a_k, (r + offset) x R a_k].
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from identification.words import Dof, Layout, Real, UsageError, is_hammer, node_of
from mbmodel.linearisation.drawing import Placed
from mbmodel.machine import Machine
from mbmodel.mjcf.edit import Edit, NotHeld
from mbmodel.parts.part import Change, Known, Parameter, Situation
from mbmodel.spatial import cross_matrix, rotation_matrix, rotation_slopes

_AXES = "xyz"


@dataclass(frozen=True, eq=False)
class _Point:
    """A point on a body, and its rows per motion of that body's centre.

    Args:
        name: of the site.
        arm: from the body's centre [m]; (3,).
        axes: in columns, in world axes; (3, 3).
        frame: selects the body's motion; (6 n_body, 6).
    """

    name: str
    arm: Real
    axes: Real
    frame: Real

    def rows(self, offset: Real, turn: Real) -> Real:
        """Rows of tx ty tz rx ry rz of the displaced and turned point; (..., 6, 6) as turns are."""
        axes = np.swapaxes(turn @ self.axes, -1, -2)
        rows = np.zeros((*axes.shape[:-2], 6, 6))
        rows[..., :3, :3] = rows[..., 3:, 3:] = axes
        rows[..., :3, 3:] = axes @ cross_matrix(self.arm + offset).T
        return rows

    def offset_slopes(self, turn: Real) -> Real:
        """Derivatives of the rows by the offset; (3, 6, 6)."""
        axes = (turn @ self.axes).T
        slopes = np.zeros((3, 6, 6))
        for k, unit in enumerate(np.eye(3)):
            slopes[k, :3, 3:] = axes @ cross_matrix(unit).T
        return slopes

    def rotation_slopes(self, offset: Real, rotation: Real) -> Real:
        """Derivatives of the rows by the rotation vector; (3, 6, 6)."""
        return self.rows(offset, rotation_slopes(rotation))


@dataclass(frozen=True, eq=False)
class SensorPart:
    """Gains of a triaxial accelerometer's channels, its rotation and its displacement.

    Args:
        point: the site.
        placed: the same in the MJCF.
    """

    point: _Point
    placed: Placed

    @property
    def location(self) -> str:
        """``sensor:<site>``."""
        return f"sensor:{self.point.name}"

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Three gains, the rotation vector, the displacement."""
        name = self.point.name
        return (
            *(Parameter(f"{name}.gain_{axis}", 1.0, "1", known="sensor_gain") for axis in _AXES),
            *_displaced(name, "sensor_angle", "sensor_position"),
        )

    def changes(self, theta: Real, situation: Situation) -> tuple[Change, ...]:
        """Rows at theta less those of the drawing."""
        del situation
        core = np.zeros((3, 6, 6))
        core[0] = _gains(theta) * self.point.rows(theta[6:], rotation_matrix(theta[3:6]))
        core[0] -= self.point.rows(np.zeros(3), np.eye(3))
        return (self._change(core),)

    def slopes(self, theta: Real, situation: Situation) -> tuple[Change, ...]:
        """Derivatives of the rows."""
        del situation
        turn, offset = rotation_matrix(theta[3:6]), theta[6:]
        rows = self.point.rows(offset, turn)
        core = np.zeros((9, 3, 6, 6))
        for k in range(3):
            core[k, 0, k] = rows[k]
        core[3:6, 0] = _gains(theta) * self.point.rotation_slopes(offset, theta[3:6])
        core[6:, 0] = _gains(theta) * self.point.offset_slopes(turn)
        return (self._change(core),)

    def _change(self, core: Real) -> Change:
        return Change("sensor", np.eye(6), self.point.frame, core, self.point.name)

    def write(self, theta: Real) -> tuple[Edit | NotHeld, ...]:
        """Place and axes of the site; an MJCF has no gains."""
        name = self.point.name
        gains = tuple(
            NotHeld(f"{name}.gain_{axis}", "an MJCF site has no gain")
            for axis, gain in zip(_AXES, theta[:3], strict=True)
            if gain != 1
        )
        if not theta[3:].any():
            return gains
        return (_site(self.placed, theta[6:], rotation_matrix(theta[3:6])), *gains)


def _displaced(name: str, angle: Known, position: Known) -> tuple[Parameter, ...]:
    """A rotation vector and a displacement, in world axes."""
    return tuple(
        Parameter(f"{name}.{kind}_{axis}", 0.0, unit, positive=False, known=known)
        for kind, unit, known in (("rotation", "rad", angle), ("position", "m", position))
        for axis in _AXES
    )


def _gains(theta: Real) -> Real:
    return np.concatenate([theta[:3], np.ones(3)])[:, None]


@dataclass(frozen=True, eq=False)
class HammerPart:
    """Where and along what the hits of one direction really went.

    Args:
        point: the site that is hit.
        dof: the direction meant, along the site's axis.
    """

    point: _Point
    dof: Dof

    @property
    def location(self) -> str:
        """``hammer:<site>``."""
        return f"hammer:{self.point.name}"

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The rotation vector and the displacement."""
        name = f"hammer({self.point.name}:{self.dof.direction[1:]})"
        return _displaced(name, "hammer_angle", "hammer_position")

    @cached_property
    def _only(self) -> Real:
        """Keeps the direction meant; (6, 6)."""
        return np.diag((np.arange(6) == self.dof.axis).astype(float))

    def changes(self, theta: Real, situation: Situation) -> tuple[Change, ...]:
        """The column at theta less that of the drawing."""
        del situation
        core = np.zeros((3, 6, 6))
        core[0] = self.point.rows(theta[3:], rotation_matrix(theta[:3]))
        core[0] -= self.point.rows(np.zeros(3), np.eye(3))
        return (self._change(core),)

    def slopes(self, theta: Real, situation: Situation) -> tuple[Change, ...]:
        """Derivatives of the column."""
        del situation
        core = np.zeros((6, 3, 6, 6))
        core[:3, 0] = self.point.rotation_slopes(theta[3:], theta[:3])
        core[3:, 0] = self.point.offset_slopes(rotation_matrix(theta[:3]))
        return (self._change(core),)

    def _change(self, core: Real) -> Change:
        return Change("hammer", self._only, self.point.frame, core, self.point.name)

    def write(self, theta: Real) -> tuple[Edit | NotHeld, ...]:
        """The drawn place: the hits of each direction have a place and an aim of their own."""
        stays = () if is_hammer(self.point.name) else (Edit("hit", self.point.name, {}),)
        if not theta.any():
            return stays
        name = self.parameters[0].name.split(".")[0]
        return (*stays, NotHeld(name, "an MJCF site has one place and one set of axes"))


def _site(placed: Placed, offset: Real, turn: Real) -> Edit:
    axes = placed.frame.T @ turn @ placed.frame @ placed.axes
    return Edit(
        "site",
        placed.name,
        {
            "pos": tuple((placed.position + placed.frame.T @ offset).tolist()),
            "quat": tuple(Rotation.from_matrix(axes).as_quat(scalar_first=True).tolist()),
        },
    )


def sensor_parts(machine: Machine) -> tuple[SensorPart, ...]:
    """One Part for each accelerometer."""
    return tuple(
        SensorPart(_point(machine.layout, name), machine.drawing.sites[name])
        for name in machine.layout.points
        if node_of(name) is not None and not is_hammer(name)
    )


def hammer_parts(machine: Machine, directions: tuple[Dof, ...]) -> tuple[HammerPart, ...]:
    """One Part for each direction hit.

    Raises:
        UsageError: a point that the machine does not have.
    """
    return tuple(HammerPart(_point(machine.layout, dof.point), dof) for dof in directions)


def _point(layout: Layout, name: str) -> _Point:
    if name not in layout.points:
        raise UsageError(f"{name!r} is no point of the machine: {', '.join(layout.points)}")
    index = layout.points.index(name)
    body = int(layout.body_of[index])
    frame = np.zeros((6 * len(layout.bodies), 6))
    frame[6 * body : 6 * body + 6] = np.eye(6)
    return _Point(name, layout.positions[index] - layout.centres[body], layout.axes[index], frame)
