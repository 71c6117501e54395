"""The sensors of one body with their errors: gain of each channel, angles and place of each."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from identification.words import Dof, Integers, Layout, Mask, Real, Tolerance

_SMALLEST = 1e-6
_UNITS = np.eye(3)


@dataclass(frozen=True, eq=False)
class Sensors:
    """Drawn places and axes of a body's channels, in world axes.

    The errors p are one vector: relative gain of each channel, then three angles of each sensor
    [rad], then three offsets of each sensor [m]; (n_channel + 6 n_sensor,).

    Args:
        channels: along their positive directions; n_channel.
        names: of the sensors, each once; n_sensor.
        sensor_of: number of the sensor of each channel; (n_channel,).
        axes: unit vectors along which channels read; (n_channel, 3).
        arms: sensors from the centre of mass [m]; (n_sensor, 3).
        moving: projector onto the motions that the body makes, all unless some were measured to
            be none; (6, 6).
    """

    channels: tuple[Dof, ...]
    names: tuple[str, ...]
    sensor_of: Integers
    axes: Real
    arms: Real
    moving: Real = field(default_factory=lambda: np.eye(6))

    @classmethod
    def of(cls, layout: Layout, channels: tuple[Dof, ...]) -> "Sensors":
        """The sensors of these channels, all on one body."""
        names = tuple(dict.fromkeys(dof.point for dof in channels))
        place = [layout.points.index(name) if name in layout.points else None for name in names]
        body = layout.bodies.index(layout.body_name(names[0]))
        frames = [np.eye(3) if k is None else layout.axes[k] for k in place]
        centre = layout.centres[body]
        return cls(
            channels,
            names,
            np.array([names.index(dof.point) for dof in channels]),
            np.array([frames[names.index(dof.point)][:, dof.axis % 3] for dof in channels]),
            np.array([np.zeros(3) if k is None else layout.positions[k] - centre for k in place]),
        )

    @property
    def count(self) -> int:
        """How many errors there are."""
        return len(self.channels) + 6 * len(self.names)

    @cached_property
    def turning(self) -> Mask:
        """Which channels read a rotation; (n_channel,)."""
        return np.array([dof.is_rotation for dof in self.channels])

    def gains(self, sensor: int) -> list[int]:
        """Numbers of the channels of a sensor, which are those of their gains in p."""
        return [int(c) for c in np.flatnonzero(self.sensor_of == sensor)]

    def angles(self, sensor: int) -> list[int]:
        """Where a sensor's angles are in p."""
        start = len(self.channels) + 3 * sensor
        return [start, start + 1, start + 2]

    def offsets(self, sensor: int) -> list[int]:
        """Where a sensor's offsets are in p."""
        start = len(self.channels) + 3 * (len(self.names) + sensor)
        return [start, start + 1, start + 2]

    def spread(self, tolerance: Tolerance) -> Real:
        """One standard deviation of each error; (n_error,)."""
        sizes = (tolerance.sensor_gain, tolerance.sensor_angle, tolerance.sensor_position)
        counts = (len(self.channels), 3 * len(self.names), 3 * len(self.names))
        return np.repeat(np.maximum(sizes, _SMALLEST), counts)

    def rows(self, errors: Real) -> Real:
        """Readings per motion of the centre (tx ty tz rx ry rz): (1 + g) [a, r x a], a turned.

        A channel that reads a rotation has (1 + g) [0, a].

        Args:
            errors: p.

        Returns:
            Rows [1, m]; (n_channel, 6).
        """
        gain, axes, arms = self._split(errors)
        return gain[:, None] * self._unit_rows(axes, arms) @ self.moving

    def slopes(self, errors: Real) -> Real:
        """Derivatives of ``rows``; angles turn beyond those in p: a + d x a; (n_error, ...)."""
        gain, axes, arms = self._split(errors)
        count, sensors = len(self.channels), len(self.names)
        channel = np.arange(count)
        slopes = np.zeros((self.count, count, 6))
        slopes[channel, channel] = self._unit_rows(axes, arms)
        turned = gain[:, None] * _cross(_UNITS[:, None], axes)  # (3, n_channel, 3)
        place = count + 3 * self.sensor_of + np.arange(3)[:, None]
        slopes[place, channel] = self._unit_rows(turned, arms)
        slopes[place + 3 * sensors, channel, 3:] = np.where(self.turning[:, None], 0.0, turned)
        return slopes @ self.moving

    def step(self, errors: Real, change: Real) -> Real:
        """Add a change to p, angles by turning further."""
        new = errors + change
        block = slice(len(self.channels), len(self.channels) + 3 * len(self.names))
        before = Rotation.from_rotvec(errors[block].reshape(-1, 3))
        more = Rotation.from_rotvec(change[block].reshape(-1, 3))
        new[block] = (more * before).as_rotvec().ravel()
        return new

    def _split(self, errors: Real) -> tuple[Real, Real, Real]:
        count, sensors = len(self.channels), len(self.names)
        turns = _matrices(errors[count : count + 3 * sensors].reshape(sensors, 3))
        axes = (turns[self.sensor_of] @ self.axes[:, :, None])[:, :, 0]
        arms = (self.arms + errors[count + 3 * sensors :].reshape(sensors, 3))[self.sensor_of]
        return 1 + errors[:count], axes, arms

    def _unit_rows(self, axes: Real, arms: Real) -> Real:
        rows = np.zeros((*axes.shape[:-1], 6))
        moving = ~self.turning
        rows[..., moving, :3] = axes[..., moving, :]
        rows[..., moving, 3:] = _cross(arms, axes)[..., moving, :]
        rows[..., self.turning, 3:] = axes[..., self.turning, :]
        return rows


def _cross(first: Real, second: Real) -> Real:
    """Cross product along the last axis, without the overhead that numpy's has on few vectors."""
    x, y, z = first[..., 0], first[..., 1], first[..., 2]
    u, v, w = second[..., 0], second[..., 1], second[..., 2]
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def _matrices(vectors: Real) -> Real:
    """Rotation matrices of rotation vectors: 1 + sinc(t) K + sinc(t / 2)^2 K^2 / 2 (Rodrigues)."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None] / np.pi
    skew = np.swapaxes(_cross(vectors[:, None], _UNITS), 1, 2)
    turned: Real = _UNITS + np.sinc(angle) * skew + 0.5 * np.sinc(angle / 2) ** 2 * (skew @ skew)
    return turned
