"""Layout: centres of mass of the solid bodies, and sensor and hammer points on them."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from identification.words._arrays import MAX_INPUT_MAGNITUDE, Integers, Real, frozen_array
from identification.words.errors import UsageError
from identification.words.names import shorten_names
from identification.words.ports import Dof, Port, Signal, parse_port

_NODE_SUFFIX = re.compile(r"(\d+)$")
_HAMMER_POINT = re.compile(r"hit\d+$")
_AXIS_LENGTH_ERROR = 1e-6  # of a unit axis: rounding of what a file states


@dataclass(frozen=True, eq=False)
class Layout:
    """Solid bodies and the points on them, in world axes, at rest.

    Args:
        bodies: names of the bodies; n_body.
        centres: centres of mass [m]; (n_body, 3).
        points: names of sensor and hammer points; n_point.
        body_of: index of the body on which each point sits; (n_point,).
        positions: positions of the points [m]; (n_point, 3).
        axes: unit axes of the points as columns, in world axes; (n_point, 3, 3). A flipped
            sensor channel has a flipped column, so the axes need not be right-handed.
        without_sensor: names of points that carry no sensor although they end in a number, such
            as the ends of tendons.
        remarks: sentences on what was read, such as axes that a file turns.

    Raises:
        ValueError: a shape or name contradicts this description.
    """

    bodies: tuple[str, ...]
    centres: Real
    points: tuple[str, ...]
    body_of: Integers
    positions: Real
    axes: Real
    without_sensor: frozenset[str] = frozenset()
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Validate and freeze."""
        n_body, n_point = len(self.bodies), len(self.points)
        checked: dict[str, Any] = {
            "centres": frozen_array(
                self.centres, np.float64, (n_body, 3), "centres", MAX_INPUT_MAGNITUDE
            ),
            "body_of": frozen_array(self.body_of, np.intp, (n_point,), "body_of"),
            "positions": frozen_array(
                self.positions, np.float64, (n_point, 3), "positions", MAX_INPUT_MAGNITUDE
            ),
            "axes": frozen_array(self.axes, np.float64, (n_point, 3, 3), "axes"),
            "bodies": tuple(self.bodies),
            "points": tuple(self.points),
        }
        names = self.bodies + self.points
        duplicates = sorted({name for name in names if names.count(name) > 1})
        if duplicates:
            raise ValueError(f"{', '.join(duplicates)} names more than one body or point")
        lengths = np.linalg.norm(checked["axes"], axis=1)
        if (np.abs(lengths - 1.0) > _AXIS_LENGTH_ERROR).any():
            raise ValueError("axes must be unit vectors, as columns")
        if not np.isin(checked["body_of"], np.arange(n_body)).all():
            raise ValueError("body_of holds an index that no body has")
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        """Return the names of bodies and points in a few lines."""
        return f"bodies: {shorten_names(self.bodies)}\npoints: {shorten_names(self.points)}"

    def rows(self, dofs: Sequence[Port]) -> Real:
        """Return the rigid-body rows: motion at each degree of freedom per motion of the bodies.

        A point at ``r`` from the centre of mass of its body moves by v + theta x r. Along its
        axis ``a`` that is a.v + (r x a).theta (seed, eq. 2.2 to 2.4). The transposed rows map a
        force along ``a`` at the point to force and moment at the centre: a and r x a.

        Args:
            dofs: n degrees of freedom at points of the layout, or at bodies (world axes). A signal,
                which is no single direction at a point, has a row of zeros.

        Returns:
            Rows [1, m, 1/m]; (n, 6 n_body), with six columns for each body: tx ty tz rx ry rz.

        Raises:
            UsageError: the layout does not have one of the points.
        """
        rows = np.zeros((len(dofs), len(self.bodies), 6))
        for row, dof in zip(rows, dofs, strict=True):
            if isinstance(dof, Signal):
                continue
            body, arm, axes = self._place(dof.point)
            axis = dof.sign * axes[:, dof.axis % 3]
            if dof.is_rotation:
                row[body, 3:] = axis
            else:
                row[body, :3] = axis
                (x, y, z), (a, b, c) = arm.tolist(), axis.tolist()
                row[body, 3:] = y * c - z * b, z * a - x * c, x * b - y * a
        return rows.reshape(len(dofs), 6 * len(self.bodies))

    def _place(self, point: str) -> tuple[int, Real, Real]:
        """Return body index, position from the centre of mass [m] and axes of a point or body."""
        if point in self.points:
            index = self.points.index(point)
            body = int(self.body_of[index])
            return body, self.positions[index] - self.centres[body], self.axes[index]
        if point in self.bodies:
            return self.bodies.index(point), np.zeros(3), np.eye(3)
        raise UsageError(
            f"{point!r} is neither a point nor a body: there are the points "
            f"{shorten_names(self.points)} and the bodies {shorten_names(self.bodies)}"
        )

    def body_name(self, point: str) -> str:
        """Return the name of the body on which a point sits.

        Raises:
            UsageError: the layout does not have the point.
        """
        return self.bodies[self._place(point)[0]]

    def parse(self, text: str) -> Port:
        """Return the direction at a point, or the signal, that a text names.

        Raises:
            UsageError: the text is no label.
        """
        return parse_port(text, (*self.points, *self.bodies))

    def owner_name(self, port: Port) -> str:
        """Return the name of the body at which a port sits; a signal stands for itself.

        Raises:
            UsageError: the layout does not have the point.
        """
        return port.point if isinstance(port, Signal) else self.body_name(port.point)

    @property
    def sensors(self) -> tuple[str, ...]:
        """Points that carry an accelerometer: their names end in its node's number."""
        return tuple(
            name
            for name in self.points
            if node_number(name) is not None
            and not is_hammer_point(name)
            and name not in self.without_sensor
        )

    def sensor_at_node(self, node: int) -> str | None:
        """Return the first sensor point whose name ends in this node number, or None."""
        names = [name for name in self.sensors if node_number(name) == node]
        return names[0] if names else None

    def hammer_at_node(self, node: int) -> str | None:
        """Return the name of the hammer point ``hit<node>``, else of the sensor at this node."""
        hits = [name for name in self.points if is_hammer_point(name) and node_number(name) == node]
        return hits[0] if hits else self.sensor_at_node(node)

    def body_dofs(self) -> tuple[Dof, ...]:
        """Return the six degrees of freedom of the centre of mass of every body."""
        return tuple(Dof.of(body, axis) for body in self.bodies for axis in range(6))

    def with_copied_point(self, point: str, name: str) -> Self:
        """Return the layout with one more point, at the position and with the axes of another.

        Args:
            point: name of the point that is copied.
            name: name of the new point.
        """
        index = self.points.index(point)
        return replace(
            self,
            points=(*self.points, name),
            body_of=np.append(self.body_of, self.body_of[index]),
            positions=np.vstack([self.positions, self.positions[index]]),
            axes=np.concatenate([self.axes, self.axes[index : index + 1]]),
        )

    def with_point_axes(self, point: str, axes: Real, body: str | None = None) -> Self:
        """Return the layout with new axes and, if given, a new body for one point.

        Args:
            point: name of the point.
            axes: new axes as columns, in world axes; (3, 3).
            body: name of the new body, or None to keep the body.
        """
        index = self.points.index(point)
        new_axes, body_of = self.axes.copy(), self.body_of.copy()
        new_axes[index] = axes
        if body is not None:
            body_of[index] = self.bodies.index(body)
        return replace(self, axes=new_axes, body_of=body_of)


def node_number(site: str) -> int | None:
    """Return the node number in which the name of a site ends, or None."""
    match = _NODE_SUFFIX.search(site)
    return int(match[1]) if match else None


def is_hammer_point(site: str) -> bool:
    """Return whether a site is a hammer point, ``hit<node>``."""
    return _HAMMER_POINT.match(site) is not None
