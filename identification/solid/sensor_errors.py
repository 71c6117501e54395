"""Sensors of one body with their errors: gains, angles, places, cross-talk and delays.

A channel with gain g, symmetric transverse sensitivity S and delay tau reads

    y_k = exp(-i w tau_k) (g_k l_k + sum_j S_kj l_j) (v, w),

with l_k = [R a_k, r x R a_k] the row of an axis. Delays are no part of the rows, which are real:
``DelayedSums`` removes them from the readings.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from identification.solid.rotation_vectors import (
    compose_rotations,
    cross_product,
    rotation_matrices,
)
from identification.words import Complex, Dof, Integers, Layout, Mask, Real, Tolerance

_MIN_TOLERANCE = 1e-6  # of a gain [1], an angle [rad] or a place [m], so that priors stay proper
_UNIT_VECTORS = np.eye(3)  # world axes
_CROSS_PAIRS = ((0, 1), (0, 2), (1, 2))  # axes of a sensor that a transverse sensitivity joins


@dataclass(frozen=True, eq=False)
class SlopeEntries:
    """Derivatives of the rows by errors, of those pairs of error and channel that have one.

    Args:
        error: number of the error, ascending; (n,).
        channel: number of the channel; (n,).
        rows: derivative of the channel's row by the error; (n, 6).
    """

    error: Integers
    channel: Integers
    rows: Real


@dataclass(frozen=True, eq=False)
class Sensors:
    """Nominal places and axes of a body's channels, in world axes.

    The errors p are one vector: relative gain of each channel, three angles of each sensor [rad],
    three offsets of each sensor [m], then, where they have a tolerance, three transverse
    sensitivities of each sensor (xy, xz, yz) and the delay of each channel [s]; (n_error,).

    Args:
        channels: degrees of freedom along their positive directions; n_channel.
        names: names of the sensors, each once; n_sensor.
        sensor_of: number of the sensor of each channel; (n_channel,).
        axes: unit vectors along which channels read; (n_channel, 3).
        arms: places of the sensors from the centre of mass [m]; (n_sensor, 3).
        frames: axes x, y, z of the sensors in columns; (n_sensor, 3, 3).
        has_cross: whether transverse sensitivities are among the errors.
        has_delays: whether delays of channels are among the errors.
        moving: projector onto the motions that the body makes; all, unless some were measured to
            vanish; (6, 6).
    """

    channels: tuple[Dof, ...]
    names: tuple[str, ...]
    sensor_of: Integers
    axes: Real
    arms: Real
    frames: Real
    has_cross: bool = False
    has_delays: bool = False
    moving: Real = field(default_factory=lambda: np.eye(6))

    @classmethod
    def of(
        cls,
        layout: Layout,
        channels: tuple[Dof, ...],
        *,
        has_cross: bool = False,
        has_delays: bool = False,
    ) -> "Sensors":
        """Return the sensors of these channels, which are all on one body."""
        names = tuple(dict.fromkeys(dof.point for dof in channels))
        site = [layout.points.index(name) if name in layout.points else None for name in names]
        body = layout.bodies.index(layout.body_name(names[0]))
        frames = [np.eye(3) if k is None else layout.axes[k] for k in site]
        centre = layout.centres[body]
        return cls(
            channels,
            names,
            np.array([names.index(dof.point) for dof in channels]),
            np.array([frames[names.index(dof.point)][:, dof.axis % 3] for dof in channels]),
            np.array([np.zeros(3) if k is None else layout.positions[k] - centre for k in site]),
            np.array(frames),
            has_cross,
            has_delays,
        )

    @property
    def count(self) -> int:
        """Number of errors."""
        return sum(self._sizes)

    @property
    def _sizes(self) -> tuple[int, int, int, int, int]:
        """Numbers of gains, angles, offsets, transverse sensitivities and delays."""
        channels, vectors = len(self.channels), 3 * len(self.names)
        return (
            channels,
            vectors,
            vectors,
            vectors if self.has_cross else 0,
            channels if self.has_delays else 0,
        )

    def delays(self, errors: Real) -> Real | None:
        """Return the delay of each channel [s], (n_channel,); None if delays are no errors."""
        return errors[-len(self.channels) :] if self.has_delays else None

    def delay_factor(self, errors: Real, freq_hz: Real) -> Complex | float:
        """Return the reading of each channel over that without its delay; (n_freq, n_channel)."""
        delays = self.delays(errors)
        if delays is None:
            return 1.0
        return np.asarray(np.exp(-2j * np.pi * freq_hz[:, None] * delays), complex)

    @cached_property
    def turning(self) -> Mask:
        """Whether a channel reads a rotation; (n_channel,)."""
        return np.array([dof.is_rotation for dof in self.channels])

    def gains(self, sensor: int) -> list[int]:
        """Return the numbers of a sensor's channels, which index their gains in p too."""
        return [int(c) for c in np.flatnonzero(self.sensor_of == sensor)]

    def angles(self, sensor: int) -> list[int]:
        """Return the positions of a sensor's angles in p."""
        start = len(self.channels) + 3 * sensor
        return [start, start + 1, start + 2]

    def offsets(self, sensor: int) -> list[int]:
        """Return the positions of a sensor's offsets in p."""
        start = len(self.channels) + 3 * (len(self.names) + sensor)
        return [start, start + 1, start + 2]

    def spread(self, tolerance: Tolerance) -> Real:
        """Return the prior standard deviation of each error; (n_error,)."""
        sizes = (tolerance.sensor_gain, tolerance.sensor_angle, tolerance.sensor_position)
        deviations = (
            *np.maximum(sizes, _MIN_TOLERANCE),
            tolerance.sensor_cross,
            tolerance.sensor_delay,
        )
        return np.repeat(deviations, self._sizes)

    def rows(self, errors: Real) -> Real:
        """Compute readings per motion of the centre: (1 + g) [a, r x a] + S [a, r x a], a rotated.

        Motions are (tx ty tz rx ry rz). A channel that reads a rotation has (1 + g) [0, a].

        Args:
            errors: p.

        Returns:
            Rows [1, m]; (n_channel, 6).
        """
        gain, frames, axes, arms = self._decompose(errors)
        mixed = gain[:, None] * axes
        if self.has_cross:
            crossed = self._cross_axes(errors, frames)
            if self._any_turning:
                crossed = np.where(self.turning[:, None], 0.0, crossed)
            mixed = mixed + crossed
        return self._unit_rows(mixed, arms) @ self.moving

    def slopes(self, errors: Real) -> Real:
        """Compute the derivatives of ``rows``; (n_error, n_channel, 6).

        Angles are increments beyond those in p: a + d x a.
        """
        entries = self.slope_entries(errors)
        slopes = np.zeros((self.count, len(self.channels), 6))
        slopes[entries.error, entries.channel] = entries.rows
        return slopes

    def slope_entries(self, errors: Real) -> SlopeEntries:
        """Compute the derivatives of ``rows`` by each error at each channel that it concerns."""
        gain, frames, axes, arms = self._decompose(errors)
        count = len(self.channels)
        turned = gain[:, None] * cross_product(_UNIT_VECTORS[:, None], axes)  # (3, n_channel, 3)
        if self.has_cross:
            mixed = self._cross_axes(errors, frames)
            if self._any_turning:
                mixed = np.where(self.turning[:, None], 0.0, mixed)
            turned = turned + cross_product(_UNIT_VECTORS[:, None], mixed)
        rows = np.zeros((len(self._entry_order), 6))
        rows[:count] = self._unit_rows(axes, arms)
        rows[count : 4 * count] = self._unit_rows(turned, arms).reshape(-1, 6)
        rows[4 * count : 7 * count, 3:] = turned.reshape(-1, 3)
        if self._any_turning:
            rows[4 * count : 7 * count, 3:] *= np.tile(~self.turning, 3)[:, None]
        if self.has_cross:
            channel, _, second = self._cross_entries
            mixed_axes = frames[self.sensor_of[channel], :, second]
            rows[7 * count :, :3] = mixed_axes
            rows[7 * count :, 3:] = cross_product(arms[channel], mixed_axes)
        error, channel = self._entry_places
        return SlopeEntries(error, channel, (rows @ self.moving)[self._entry_order])

    @cached_property
    def _unordered_places(self) -> Integers:
        """Error and channel of each derivative: gains, angles, offsets, sensitivities; (2, n)."""
        channel = np.arange(len(self.channels))
        angle = len(channel) + 3 * self.sensor_of + np.arange(3)[:, None]
        error = [channel, angle.ravel(), angle.ravel() + 3 * len(self.names)]
        places = [channel, np.tile(channel, 3), np.tile(channel, 3)]
        if self.has_cross:
            error.append(self._cross_entries[1])
            places.append(self._cross_entries[0])
        return np.array([np.concatenate(error), np.concatenate(places)])

    @cached_property
    def _entry_order(self) -> Integers:
        """Order of the derivatives by their errors; (n,)."""
        return np.argsort(self._unordered_places[0], kind="stable")

    @cached_property
    def _entry_places(self) -> Integers:
        """Error and channel of each derivative, in the order of the errors; (2, n)."""
        return self._unordered_places[:, self._entry_order]

    def step(self, errors: Real, change: Real) -> Real:
        """Add a change to p, with rotations composed."""
        stepped = errors + change
        block = slice(len(self.channels), len(self.channels) + 3 * len(self.names))
        stepped[block] = compose_rotations(
            change[block].reshape(-1, 3), errors[block].reshape(-1, 3)
        ).ravel()
        return stepped

    def _decompose(self, errors: Real) -> tuple[Real, Real, Real, Real]:
        """Return gains, rotated frames of the sensors, rotated axes and displaced arms."""
        count, sensors = len(self.channels), len(self.names)
        turns = rotation_matrices(errors[count : count + 3 * sensors].reshape(sensors, 3))
        axes = (turns[self.sensor_of] @ self.axes[:, :, None])[:, :, 0]
        offsets = errors[count + 3 * sensors : count + 6 * sensors].reshape(sensors, 3)
        arms = (self.arms + offsets)[self.sensor_of]
        return 1 + errors[:count], turns @ self.frames, axes, arms

    def _cross_axes(self, errors: Real, frames: Real) -> Real:
        """Return sum_j S_kj R a_j of each channel, R a_j from rotated frames; (n_channel, 3)."""
        first = len(self.channels) + 6 * len(self.names)
        sizes = errors[first : first + 3 * len(self.names)].reshape(-1, 3)
        matrices = np.zeros((len(self.names), 3, 3))
        for pair, (a, b) in enumerate(_CROSS_PAIRS):
            matrices[:, a, b] = matrices[:, b, a] = sizes[:, pair]
        return np.asarray((frames @ matrices)[self.sensor_of, :, self._axis_of], float)

    @cached_property
    def _axis_of(self) -> Integers:
        """Axis of its sensor along which each channel reads; (n_channel,)."""
        return np.array([dof.axis % 3 for dof in self.channels], np.intp)

    @cached_property
    def _cross_entries(self) -> Integers:
        """Channel, error and second axis of each transverse sensitivity in a channel; (3, n)."""
        first = len(self.channels) + 6 * len(self.names)
        entries = [
            (k, first + 3 * self.sensor_of[k] + pair, sum(axes) - dof.axis)
            for k, dof in enumerate(self.channels)
            for pair, axes in enumerate(_CROSS_PAIRS)
            if dof.axis in axes
        ]
        return np.array(entries, np.intp).reshape(-1, 3).T

    @cached_property
    def _any_turning(self) -> bool:
        """Whether any channel reads a rotation."""
        return bool(self.turning.any())

    def _unit_rows(self, axes: Real, arms: Real) -> Real:
        """Return rows of channels that read along these axes; (..., n_channel, 6)."""
        rows = np.empty((*axes.shape[:-1], 6))
        rows[..., :3] = axes
        rows[..., 3:] = cross_product(arms, axes)
        if self._any_turning:
            rows[..., self.turning, :3] = 0.0
            rows[..., self.turning, 3:] = axes[..., self.turning, :]
        return rows
