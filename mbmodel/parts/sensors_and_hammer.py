"""Parts for errors of sensors and of the hammer: gain, orientation, position, delay.

The row of a point's direction k reads ``a_k.(v + w x r)``, with the axis a_k at r from the body's
centre. The column of a hammer direction is its transpose: both are [a_k, r x a_k] (seed, eq. 2.2 to
2.4). With true axes R a_k and the true place r + offset, rotation and offset in world axes, it
becomes l_k = [R a_k, (r + offset) x R a_k]. A sensor of gains g, transverse sensitivity S and
delays tau reads

    y_k = exp(-s tau_k) sum_j (diag(g) + S)_kj l_j (v, w).

S is symmetric with a zero diagonal: the antisymmetric part of a transverse sensitivity turns the
axes, as R does.
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from identification.words import Dof, Integers, Layout, Real, UsageError, is_hammer_point
from mbmodel.linearisation.drawing import DrawnElement
from mbmodel.machine import Machine
from mbmodel.mjcf.edit import Edit, MjcfLack, NotInMjcf
from mbmodel.parts.part import (
    AXIS_NAMES,
    Change,
    Parameter,
    PartContext,
    ToleranceKind,
    drawn_values,
)
from mbmodel.spatial import cross_matrix, rotation_matrix, rotation_slopes

T = TypeVar("T", bound=np.generic)


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

    @cached_property
    def drawn_rows(self) -> Real:
        """Rows of the point as drawn; (6, 6)."""
        return self.rows(np.zeros(3), np.eye(3))

    def rows(self, offset: Real, turn: Real) -> Real:
        """Return rows of tx ty tz rx ry rz of the displaced and turned point; (..., 6, 6)."""
        axes = np.swapaxes(turn @ self.axes, -1, -2)
        rows = np.zeros((*axes.shape[:-2], 6, 6))
        rows[..., :3, :3] = rows[..., 3:, 3:] = axes
        rows[..., :3, 3:] = axes @ cross_matrix(self.arm + offset).T
        return rows

    def offset_slopes(self, turn: Real) -> Real:
        """Return derivatives of the rows by the offset; (3, 6, 6)."""
        slopes = np.zeros((3, 6, 6))
        slopes[:, :3, 3:] = (turn @ self.axes).T @ _UNIT_CROSS.swapaxes(1, 2)
        return slopes

    def rotation_slopes(self, offset: Real, rotation: Real) -> Real:
        """Return derivatives of the rows by the rotation vector; (3, 6, 6)."""
        return self.rows(offset, rotation_slopes(rotation))


_UNIT_CROSS = np.stack([cross_matrix(unit) for unit in np.eye(3)])  # (3, 3, 3)
# Pairs of axes of the symmetric transverse sensitivity, in the order of the parameters.
_CROSS_AXES = ((0, 1), (0, 2), (1, 2))


@dataclass(frozen=True, eq=False)
class SensorPart:
    """Gains of a sensor's channels, transverse sensitivity, rotation, displacement and delays.

    A channel that reads a rotation has a gain and a delay, and turns with the sensor's axes. It
    reads the same wherever it sits on a solid body, so the displacement does not change it.

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
        """Gains, the rotation vector, the displacement, transverse sensitivities, delays."""
        name = self.point.name
        axes = (*AXIS_NAMES, *(f"r{AXIS_NAMES[axis]}" for axis in self.rotations))
        return (
            *(Parameter(f"{name}.gain_{axis}", 1.0, "1", known=self.gain_known) for axis in axes),
            *_pose_parameters(name, "sensor_angle", "sensor_position"),
            *(
                Parameter(
                    f"{name}.cross_{AXIS_NAMES[first]}{AXIS_NAMES[second]}",
                    0.0,
                    "1",
                    positive=False,
                    known="sensor_cross",
                )
                for first, second in _CROSS_AXES
            ),
            *(
                Parameter(f"{name}.delay_{axis}", 0.0, "s", positive=False, known="sensor_delay")
                for axis in axes
            ),
        )

    def changes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the rows at theta minus those of the drawing, and the delays."""
        del context
        gains, rotation, offset, cross, delays = self._separate(theta)
        core = np.zeros((3, 6, 6))
        core[0] = self._mix(gains, cross) @ self.point.rows(offset, rotation_matrix(rotation))
        core[0] -= self.point.drawn_rows
        if not delays.any():
            return (self._change(core),)
        delay_core = np.zeros((3, 6, 1))
        delay_core[1, self._channel_rows, 0] = -delays
        return (self._change(core), self._delay(delay_core))

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the derivatives of the rows and of the delays."""
        del context
        gains, rotation, offset, cross, _ = self._separate(theta)
        turn = rotation_matrix(rotation)
        rows, mix = self.point.rows(offset, turn), self._mix(gains, cross)
        core, delay_core = np.zeros((len(theta), 3, 6, 6)), np.zeros((len(theta), 3, 6, 1))
        by_gain, by_rotation, by_offset, by_cross, by_delay = self._separate(np.arange(len(theta)))
        core[by_gain, 0, self._channel_rows] = rows[self._channel_rows, :]
        core[by_rotation, 0] = mix @ self.point.rotation_slopes(offset, rotation)
        core[by_offset, 0] = mix @ self.point.offset_slopes(turn)
        for k, (first, second) in zip(by_cross, _CROSS_AXES, strict=True):
            core[k, 0, first], core[k, 0, second] = rows[second], rows[first]
        delay_core[by_delay, 1, self._channel_rows, 0] = -1.0
        return (self._change(core), self._delay(delay_core))

    @cached_property
    def _channel_rows(self) -> Integers:
        """Row of the point, 0..5, of each gain and of each delay."""
        return np.array([0, 1, 2, *(3 + axis for axis in self.rotations)])

    def _separate(self, values: NDArray[T]) -> tuple[NDArray[T], ...]:
        """Split theta into gains, rotation vector, offset, transverse sensitivities, delays."""
        n = len(self._channel_rows)
        ends = 0, n, n + 3, n + 6, n + 9, len(values)
        return tuple(values[first:last] for first, last in pairwise(ends))

    def _mix(self, gains: Real, cross: Real) -> Real:
        """Return diag(g) + S of the point's six rows; (6, 6)."""
        mix = np.eye(6)
        mix[self._channel_rows, self._channel_rows] = gains
        for size, (first, second) in zip(cross, _CROSS_AXES, strict=True):
            mix[first, second] = mix[second, first] = size
        return mix

    def _change(self, core: Real) -> Change:
        """Return a change of the sensor's rows."""
        return Change("sensor", np.eye(6), self.point.frame, core, self.point.name)

    def _delay(self, core: Real) -> Change:
        """Return a change of the logarithm of the readings' factor."""
        return Change("output", np.eye(6), np.ones((1, 1)), core, self.point.name)

    def write(self, theta: Real) -> tuple[Edit | NotInMjcf, ...]:
        """Return place and axes of the site; an MJCF has no gains, cross-talk or delays."""
        electric = tuple(
            NotInMjcf(
                parameter.name,
                MjcfLack.SENSOR_DELAY if parameter.unit == "s" else MjcfLack.SENSOR_GAIN,
            )
            for parameter, value, held in zip(
                self.parameters, theta, self.select_held(theta), strict=True
            )
            if value != held
        )
        _, rotation, offset, _, _ = self._separate(theta)
        if not (rotation.any() or offset.any()):
            return electric
        return (_site_edit(self.drawn_site, offset, rotation_matrix(rotation)), *electric)

    def select_held(self, theta: Real) -> Real:
        """Return theta with the nominal gains, cross-talk and delays: a site has a pose alone."""
        is_pose = [p.known in ("sensor_angle", "sensor_position") for p in self.parameters]
        return np.where(is_pose, theta, drawn_values(self, theta))


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
        core[0] -= self.point.drawn_rows
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
            NotInMjcf(name, MjcfLack.HIT),
        )

    def select_held(self, theta: Real) -> Real:
        """Return the nominal place and direction."""
        return drawn_values(self, theta)


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
