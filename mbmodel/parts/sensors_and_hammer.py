"""Parts for errors of sensors and of the hammer: gain, orientation, position.

The row of a point's direction k reads ``a_k.(v + w x r)``, with the axis a_k at r from the body's
centre. The column of a hammer direction is its transpose: both are [a_k, r x a_k] (seed, eq. 2.2 to
2.4). With gains g_k, true axes R a_k and the true place r + offset, rotation and offset in world
axes, a row becomes g_k [R a_k, (r + offset) x R a_k].
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from identification.words import Dof, Layout, Real, UsageError, is_hammer_point
from mbmodel.linearisation.drawing import DrawnElement
from mbmodel.machine import Machine
from mbmodel.mjcf.edit import Edit, NotInMjcf
from mbmodel.parts.part import AXIS_NAMES, Change, Parameter, PartContext, ToleranceKind
from mbmodel.spatial import cross_matrix, rotation_matrix, rotation_slopes


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
        """Return rows of tx ty tz rx ry rz of the displaced and turned point; (..., 6, 6)."""
        axes = np.swapaxes(turn @ self.axes, -1, -2)
        rows = np.zeros((*axes.shape[:-2], 6, 6))
        rows[..., :3, :3] = rows[..., 3:, 3:] = axes
        rows[..., :3, 3:] = axes @ cross_matrix(self.arm + offset).T
        return rows

    def offset_slopes(self, turn: Real) -> Real:
        """Return derivatives of the rows by the offset; (3, 6, 6)."""
        axes = (turn @ self.axes).T
        slopes = np.zeros((3, 6, 6))
        for k, unit in enumerate(np.eye(3)):
            slopes[k, :3, 3:] = axes @ cross_matrix(unit).T
        return slopes

    def rotation_slopes(self, offset: Real, rotation: Real) -> Real:
        """Return derivatives of the rows by the rotation vector; (3, 6, 6)."""
        return self.rows(offset, rotation_slopes(rotation))


@dataclass(frozen=True, eq=False)
class SensorPart:
    """Gains of a sensor's channels, its rotation and its displacement.

    A channel that reads a rotation has a gain, and turns with the sensor's axes. It reads the same
    wherever it sits on a solid body, so the displacement does not change it.

    Args:
        point: the site in the machine.
        drawn_site: the site in the MJCF.
        rotations: axes 0..2 about which a channel reads a rotation.
        gain_known: kind of the gains' prior.
    """

    point: _Point
    drawn_site: DrawnElement
    rotations: tuple[int, ...] = ()
    gain_known: ToleranceKind = "sensor_gain"

    @property
    def location(self) -> str:
        """Place in the machine, ``sensor:<site>``."""
        return f"sensor:{self.point.name}"

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Gains of translations and rotations, the rotation vector, the displacement."""
        name = self.point.name
        axes = (*AXIS_NAMES, *(f"r{AXIS_NAMES[axis]}" for axis in self.rotations))
        return (
            *(Parameter(f"{name}.gain_{axis}", 1.0, "1", known=self.gain_known) for axis in axes),
            *_pose_parameters(name, "sensor_angle", "sensor_position"),
        )

    def changes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the rows at theta minus those of the drawing."""
        del context
        gains, rotation, offset = self._unpack(theta)
        core = np.zeros((3, 6, 6))
        core[0] = gains * self.point.rows(offset, rotation_matrix(rotation))
        core[0] -= self.point.rows(np.zeros(3), np.eye(3))
        return (self._change(core),)

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the derivatives of the rows."""
        del context
        gains, rotation, offset = self._unpack(theta)
        turn = rotation_matrix(rotation)
        rows = self.point.rows(offset, turn)
        core = np.zeros((len(theta), 3, 6, 6))
        for k, row in enumerate(self._gain_rows):
            core[k, 0, row] = rows[row]
        core[-6:-3, 0] = gains * self.point.rotation_slopes(offset, rotation)
        core[-3:, 0] = gains * self.point.offset_slopes(turn)
        return (self._change(core),)

    @property
    def _gain_rows(self) -> tuple[int, ...]:
        """Row of the point, 0..5, of each gain."""
        return (0, 1, 2, *(3 + axis for axis in self.rotations))

    def _unpack(self, theta: Real) -> tuple[Real, Real, Real]:
        """Return factors of the point's six rows (6, 1), rotation vector (3,), offset (3,)."""
        gains = np.ones((6, 1))
        gains[list(self._gain_rows), 0] = theta[:-6]
        return gains, theta[-6:-3], theta[-3:]

    def _change(self, core: Real) -> Change:
        """Return a change of the sensor's rows."""
        return Change("sensor", np.eye(6), self.point.frame, core, self.point.name)

    def write(self, theta: Real) -> tuple[Edit | NotInMjcf, ...]:
        """Return place and axes of the site; an MJCF has no gains."""
        gains = tuple(
            NotInMjcf(parameter.name, "an MJCF site has no gain")
            for parameter, gain in zip(self.parameters, theta[:-6], strict=False)
            if gain != 1
        )
        rotation, offset = self._unpack(theta)[1:]
        if not theta[-6:].any():
            return gains
        return (_site_edit(self.drawn_site, offset, rotation_matrix(rotation)), *gains)


def _pose_parameters(
    name: str, angle: ToleranceKind, position: ToleranceKind
) -> tuple[Parameter, ...]:
    """Return the parameters of a rotation vector and a displacement, in world axes."""
    return tuple(
        Parameter(f"{name}.{kind}_{axis}", 0.0, unit, positive=False, known=known)
        for kind, unit, known in (("rotation", "rad", angle), ("position", "m", position))
        for axis in AXIS_NAMES
    )


@dataclass(frozen=True, eq=False)
class HammerPart:
    """True place and direction of the hits of one direction.

    Args:
        point: the site that is hit.
        dof: the intended direction, along the site's axis.
    """

    point: _Point
    dof: Dof

    @property
    def location(self) -> str:
        """Place in the machine, ``hammer:<site>``."""
        return f"hammer:{self.point.name}"

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The rotation vector and the displacement."""
        name = f"hammer({self.point.name}:{self.dof.direction[1:]})"
        return _pose_parameters(name, "hammer_angle", "hammer_position")

    @cached_property
    def _direction_mask(self) -> Real:
        """Selects the intended direction; (6, 6)."""
        return np.diag((np.arange(6) == self.dof.axis).astype(float))

    def changes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the column at theta minus that of the drawing."""
        del context
        core = np.zeros((3, 6, 6))
        core[0] = self.point.rows(theta[3:], rotation_matrix(theta[:3]))
        core[0] -= self.point.rows(np.zeros(3), np.eye(3))
        return (self._change(core),)

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the derivatives of the column."""
        del context
        core = np.zeros((6, 3, 6, 6))
        core[:3, 0] = self.point.rotation_slopes(theta[3:], theta[:3])
        core[3:, 0] = self.point.offset_slopes(rotation_matrix(theta[:3]))
        return (self._change(core),)

    def _change(self, core: Real) -> Change:
        """Return a change of the intended direction's column."""
        return Change("hammer", self._direction_mask, self.point.frame, core, self.point.name)

    def write(self, theta: Real) -> tuple[Edit | NotInMjcf, ...]:
        """Return the site as drawn: an MJCF cannot hold the errors of a hit.

        A site has one pose, but the hits of each direction have their own.
        """
        hit_site = () if is_hammer_point(self.point.name) else (Edit("hit", self.point.name, {}),)
        if not theta.any():
            return hit_site
        name = self.parameters[0].name.split(".")[0]
        return (
            *hit_site,
            NotInMjcf(name, "an MJCF site has one pose, but each hammer direction needs its own"),
        )


def _site_edit(drawn_site: DrawnElement, offset: Real, turn: Real) -> Edit:
    """Return the new pose of a site in its body's frame."""
    axes = drawn_site.frame.T @ turn @ drawn_site.frame @ drawn_site.axes
    return Edit(
        "site",
        drawn_site.name,
        {
            "pos": tuple((drawn_site.position + drawn_site.frame.T @ offset).tolist()),
            "quat": tuple(Rotation.from_matrix(axes).as_quat(scalar_first=True).tolist()),
        },
    )


def sensor_parts(
    machine: Machine, channels: Iterable[Dof] = (), unknown: Collection[str] = ()
) -> tuple[SensorPart, ...]:
    """Return one Part for each sensor.

    Args:
        machine: with the sensors.
        channels: channels that are read; those of rotations get a gain too.
        unknown: sensors whose gains are unknown.
    """
    turning = {(dof.point, dof.axis - 3) for dof in channels if dof.is_rotation}
    return tuple(
        SensorPart(
            _point(machine.layout, name),
            machine.drawing.sites[name],
            tuple(axis for axis in range(3) if (name, axis) in turning),
            "unknown_gain" if name in unknown else "sensor_gain",
        )
        for name in machine.layout.sensors
    )


def hammer_parts(machine: Machine, directions: tuple[Dof, ...]) -> tuple[HammerPart, ...]:
    """Return one Part for each direction hit by a force.

    Args:
        machine: with the points that are hit.
        directions: point and direction of each hit.

    Raises:
        UsageError: a point that the machine does not have.
    """
    return tuple(HammerPart(_point(machine.layout, dof.point), dof) for dof in directions)


def _point(layout: Layout, name: str) -> _Point:
    """Return a point of the machine by name."""
    if name not in layout.points:
        raise UsageError(
            f"{name!r} is no point of the machine: choose one of {', '.join(layout.points)}"
        )
    index = layout.points.index(name)
    body = int(layout.body_of[index])
    frame = np.zeros((6 * len(layout.bodies), 6))
    frame[6 * body : 6 * body + 6] = np.eye(6)
    return _Point(name, layout.positions[index] - layout.centres[body], layout.axes[index], frame)
