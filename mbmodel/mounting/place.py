"""Places on the bodies of a machine: a site, or an offset from the centre of mass."""

from dataclasses import dataclass

import numpy as np

from identification.words import InputError, Real, shorten_names
from mbmodel.machine import Machine

Offset = tuple[float, float, float]


@dataclass(frozen=True)
class PointMass:
    """A point mass fixed to a body.

    Args:
        body: name of the body.
        mass_kg: [kg].
        offset_m: from the body's centre of mass, in world axes [m].
    """

    body: str
    mass_kg: float
    offset_m: Offset


@dataclass(frozen=True, eq=False)
class BodyPose:
    """A point and axes in the frame of an MJCF body.

    Args:
        body: name of the body that leads the stage.
        position: in its frame [m]; (3,).
        axes: in its frame, in columns; (3, 3).
        weight_fraction: share of the body's weight that its ``gravcomp`` leaves.
    """

    body: str
    position: Real
    axes: Real
    weight_fraction: float


def find_pose(machine: Machine, body: str, place: str | Offset) -> BodyPose:
    """Return a place on a body in the body's own frame.

    The machine is at its static equilibrium. A site gives its own axes, an offset those of the
    world.

    Args:
        machine: with the body.
        place: name of a site of the body, or offset from its centre of mass in world axes [m].

    Raises:
        InputError: the machine has no such body, or the body no such site.
    """
    layout = machine.layout
    if body not in layout.bodies:
        raise InputError(
            f"{machine.source} has no moving body {body!r}: name one of "
            f"{shorten_names(layout.bodies)}"
        )
    number = layout.bodies.index(body)
    if isinstance(place, str):
        sites = [layout.points[k] for k in np.flatnonzero(layout.body_of == number)]
        if place not in sites:
            names = shorten_names(sites) if sites else "none"
            raise InputError(
                f"{machine.source}: body {body!r} has no site {place!r} (its sites: {names}): name "
                "a site of the body, or x,y,z in m from its centre of mass"
            )
        index = layout.points.index(place)
        point, axes = layout.positions[index], layout.axes[index]
    else:
        point, axes = layout.centres[number] + np.array(place), np.eye(3)
    drawn = machine.drawing.bodies[body]
    return BodyPose(
        body,
        drawn.frame.T @ (point - drawn.origin),
        drawn.frame.T @ axes,
        float(machine.weight_fraction[6 * number]),
    )
