"""Where the solid bodies have their centres of mass, and where sensors and hammer sit on them."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from identification.words._arrays import Integers, Real, frozen
from identification.words.dof import Dof
from identification.words.errors import UsageError

_NODE = re.compile(r"(\d+)$")
_HAMMER = re.compile(r"hit\d+$")


@dataclass(frozen=True, eq=False)
class Layout:
    """Solid bodies and the points on them, in world axes, at rest.

    Args:
        bodies: names of the bodies; n_body.
        centres: centres of mass [m]; (n_body, 3).
        points: names of sensor and hammer points; n_point.
        body_of: number of the body on which each point sits; (n_point,).
        positions: of the points [m]; (n_point, 3).
        axes: of the points, in columns, in world axes; (n_point, 3, 3). A flipped sensor
            channel has a flipped column, so they need not be right-handed.

    Raises:
        ValueError: shapes or names that contradict this.
    """

    bodies: tuple[str, ...]
    centres: Real
    points: tuple[str, ...]
    body_of: Integers
    positions: Real
    axes: Real

    def __post_init__(self) -> None:
        """Validate and freeze."""
        n_body, n_point = len(self.bodies), len(self.points)
        checked: dict[str, Any] = {
            "centres": frozen(self.centres, np.float64, (n_body, 3), "centres"),
            "body_of": frozen(self.body_of, np.intp, (n_point,), "body_of"),
            "positions": frozen(self.positions, np.float64, (n_point, 3), "positions"),
            "axes": frozen(self.axes, np.float64, (n_point, 3, 3), "axes"),
            "bodies": tuple(self.bodies),
            "points": tuple(self.points),
        }
        names = self.bodies + self.points
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"{', '.join(twice)} names more than one body or point")
        if not np.isin(checked["body_of"], np.arange(n_body)).all():
            raise ValueError("body_of points outside the bodies")
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    def rows(self, dofs: Sequence[Dof]) -> Real:
        """Motion at each degree of freedom per motion of the centres of mass.

        A point at r from its body's centre moves by v + theta x r; along its axis a that is
        a.v + (r x a).theta (seed, eq. 2.2 to 2.4). Transposed, the same rows carry a force at
        the point to the centres: force a, moment r x a.

        Args:
            dofs: n degrees of freedom at points of the layout, or at bodies (world axes).

        Returns:
            Rows [1, m, 1/m]; (n, 6 n_body), six columns a body: tx ty tz rx ry rz.

        Raises:
            UsageError: a point that the layout does not have.
        """
        rows = np.zeros((len(dofs), len(self.bodies), 6))
        for row, dof in zip(rows, dofs, strict=True):
            body, arm, axes = self._place(dof.point)
            axis = dof.sign * axes[:, dof.axis % 3]
            if dof.is_rotation:
                row[body, 3:] = axis
            else:
                row[body, :3] = axis
                row[body, 3:] = np.cross(arm, axis)
        return rows.reshape(len(dofs), 6 * len(self.bodies))

    def _place(self, point: str) -> tuple[int, Real, Real]:
        if point in self.points:
            index = self.points.index(point)
            body = int(self.body_of[index])
            return body, self.positions[index] - self.centres[body], self.axes[index]
        if point in self.bodies:
            return self.bodies.index(point), np.zeros(3), np.eye(3)
        raise UsageError(
            f"{point!r} is neither a point nor a body: there are "
            + ", ".join(self.points + self.bodies)
        )

    def body_name(self, point: str) -> str:
        """Name of the body on which a point sits."""
        return self.bodies[self._place(point)[0]]

    def sensor(self, node: int) -> str | None:
        """Name of the accelerometer whose name ends in this node number, if there is one."""
        found = [name for name in self.points if node_of(name) == node and not is_hammer(name)]
        return found[0] if found else None

    def hammer(self, node: int) -> str | None:
        """Name of the hammer point ``hit<node>``, else of the node's accelerometer."""
        hits = [name for name in self.points if is_hammer(name) and node_of(name) == node]
        return hits[0] if hits else self.sensor(node)

    def body_dofs(self) -> tuple[Dof, ...]:
        """The six degrees of freedom of every body's centre of mass."""
        return tuple(Dof.of(body, axis) for body in self.bodies for axis in range(6))

    def with_copy(self, point: str, name: str) -> Self:
        """The same layout with one more point where another is."""
        index = self.points.index(point)
        return replace(
            self,
            points=(*self.points, name),
            body_of=np.append(self.body_of, self.body_of[index]),
            positions=np.vstack([self.positions, self.positions[index]]),
            axes=np.concatenate([self.axes, self.axes[index : index + 1]]),
        )

    def turned(self, point: str, axes: Real, body: str | None = None) -> Self:
        """The same layout with a point's axes exchanged and, if named, its body."""
        index = self.points.index(point)
        new_axes, body_of = self.axes.copy(), self.body_of.copy()
        new_axes[index] = axes
        if body is not None:
            body_of[index] = self.bodies.index(body)
        return replace(self, axes=new_axes, body_of=body_of)


def node_of(site: str) -> int | None:
    """The UFF node number in which a site's name ends, if any."""
    match = _NODE.search(site)
    return int(match[1]) if match else None


def is_hammer(site: str) -> bool:
    """Whether a site is a hammer point, ``hit<node>``."""
    return _HAMMER.match(site) is not None
