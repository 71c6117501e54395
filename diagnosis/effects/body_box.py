"""The box of a body, in which effects on it lie, and which of their parameters its motion shows.

The box holds all that the drawing says of where a body is: its geoms, the points on it, and the
extent of its mass. A body without geoms has the joints that carry it in place of them. A uniform
bar of the second moment S about its middle reaches sqrt(3 S) to both sides, so that the mass m
reaches sqrt(3 S_kk / m) along axis k, with S = tr(I) / 2 - I.

A margin of half the largest edge is added on all sides. What is fixed to a body may stand out as
far as the body reaches from its own middle; what is farther away needs a body of its own.
"""

from collections.abc import Sequence

import numpy as np

from diagnosis.hypothesis import Scene
from diagnosis.settings import HALF_PRECISION
from identification.words import Mask, Real
from mbmodel import Machine, transport


def find_box(machine: Machine, numbers: Sequence[int]) -> Real:
    """Return the lowest and highest corner of the box about bodies with its margin [m]; (2, 3).

    Args:
        machine: with its drawing, at rest.
    """
    corners = np.vstack([_list_corners(machine, number) for number in numbers])
    low, high = corners.min(axis=0), corners.max(axis=0)
    margin = 0.5 * float((high - low).max())
    return np.array([low - margin, high + margin])


def _list_corners(machine: Machine, number: int) -> Real:
    """Return points that the box of a body holds [m]; (n, 3)."""
    layout = machine.layout
    body, centre = layout.bodies[number], layout.centres[number]
    span = slice(6 * number, 6 * number + 6)
    mass, inertia = machine.body_mass[span, span][0, 0], machine.body_mass[span, span][3:, 3:]
    second = np.maximum(np.trace(inertia) / 2 - np.diag(inertia), 0.0)
    reach = np.sqrt(3 * second / mass) if mass > 0 else np.zeros(3)
    points = layout.positions[layout.body_of == number]
    drawn = machine.drawing.bodies.get(body)  # none of the coordinate of a body's mode
    geoms = np.zeros((0, 3)) if drawn is None else drawn.geoms
    if not len(geoms):
        anchors = [axle.anchor for axle in machine.axles if axle.stage == body]
        geoms = np.reshape(anchors, (-1, 3))
    return np.vstack([centre - reach, centre + reach, points, geoms])


def bound_place(
    machine: Machine, numbers: Sequence[int], origin: Real
) -> tuple[tuple[float, float], ...]:
    """Return the lowest and highest offset from a point to the box of bodies, by axis [m].

    The point itself is always within: a point that is drawn beside its body may stay there.

    Args:
        machine: with its drawing, at rest.
        origin: the point from which offsets count [m]; (3,).
    """
    low, high = find_box(machine, numbers) - origin
    ends = np.minimum(low, 0.0).tolist(), np.maximum(high, 0.0).tolist()
    return tuple(zip(*ends, strict=True))


def find_jacobian(scene: Scene) -> Real:
    """Return the motion of the bodies per coordinate that gives way; (6 n_body, nv).

    Directions that are rigid as drawn have a coordinate on a stiff spring. Their columns are zero,
    unless the fit of the scene has a compliance there (``missing_dof``).
    """
    names = (parameter.name for parameter in scene.model.parameters)
    fitted = dict(zip(names, scene.theta.tolist(), strict=True))
    locked = [
        rigid.coordinate
        for rigid in scene.rigid_directions
        if not fitted.get(f"{rigid.stage}.{rigid.dof}.compliance", 0.0) > 0
    ]
    jacobian = scene.model.machine.jacobian.copy()
    jacobian[:, locked] = 0.0
    return jacobian


def find_moved(jacobian: Real, rows: Real) -> Mask:
    """Return which of some motions any joint makes; (n,).

    Args:
        jacobian: motion of the bodies per coordinate; (6 n_body, nv).
        rows: these motions per motion of the bodies, each one row or several; (n, ..., 6 n_body).
    """
    sizes = np.abs(rows @ jacobian).reshape(len(rows), -1).max(axis=1, initial=0.0)
    return sizes > HALF_PRECISION * np.abs(jacobian).max(initial=0.0)


def find_moved_axes(jacobian: Real, body: int) -> Mask:
    """Return the world axes along which something moves some point on a body; (3,).

    Args:
        jacobian: motion of the bodies per coordinate; (6 n_body, nv).
        body: number of the body.
    """
    points = (np.zeros(3), *np.eye(3))  # among these each turn of the body shows
    rows = np.stack([transport(point)[:3] for point in points], axis=1)
    return find_moved(jacobian[6 * body : 6 * body + 6], rows)


def find_shown_offsets(jacobian: Real, body: int, axes: Real) -> Mask:
    """Return which components of the place of a point its forces or readings show; (3,).

    An offset d of a force along a adds the moment d x a, which is felt by the body's turns alone.

    Args:
        jacobian: motion of the bodies per coordinate; (6 n_body, nv).
        body: number of the body.
        axes: directions of the forces or readings, in columns; (3, n).
    """
    moments = np.cross(np.eye(3)[:, None], axes.T)  # (3, n, 3)
    return find_moved(jacobian[6 * body + 3 : 6 * body + 6], moments)


def select_names(names: Sequence[str], chosen: Mask) -> tuple[str, ...]:
    """Return the chosen ones of names."""
    return tuple(name for name, is_chosen in zip(names, chosen.tolist(), strict=True) if is_chosen)


def hold_at_zero(names: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return the bounds of parameters that stay at zero, since nothing shows them."""
    return dict.fromkeys(names, (0.0, 0.0))
