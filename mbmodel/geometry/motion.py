"""Motion of a machine's bodies in a mode, made large enough to be seen."""

from collections.abc import Sequence

import numpy as np

from identification.words import Complex, Integers, Real
from mbmodel.geometry.surfaces import MachineGeometry
from mbmodel.spatial import cross_matrix, rotation_matrix

WORLD = -1  # stage of what stands still
_MAX_ROTATION_RAD = 0.35  # of a body in a picture: beyond it the picture misleads


def move_points(points: Real, stages: Integers, centres: Real, motion: Real) -> Real:
    """Move points with their bodies: x + t + (R - 1) (x - c), with R = exp([theta]x).

    Args:
        points: at rest, in world axes [m]; (n, 3).
        stages: number of the body of each point, ``WORLD`` for none; (n,).
        centres: centres of mass c [m]; (n_body, 3).
        motion: translation t [m] and rotation theta [rad] of each body; (n_body, 6).

    Returns:
        Moved points [m]; (n, 3).
    """
    moved = np.array(points, float)
    for body in np.unique(stages[stages != WORLD]):
        chosen = stages == body
        arm = points[chosen] - centres[body]
        turned = arm @ rotation_matrix(motion[body, 3:]).T
        moved[chosen] = centres[body] + motion[body, :3] + turned
    return moved


def motion_scale(
    points: Real, stages: Integers, centres: Real, shape: Complex, largest: float
) -> float:
    """Return the factor by which a mode shape is enlarged for a picture.

    The point that moves most then moves by ``largest``, and no body turns by more than 0.35 rad.

    Args:
        points [m] (n, 3), stages (n,): as for ``move_points``.
        centres: centres of mass [m]; (n_body, 3).
        shape: translation and rotation of each body; (n_body, 6).
        largest: largest motion of a point [m].

    Returns:
        The factor; 0 for a shape without motion.
    """
    size = 0.0
    for body in np.unique(stages[stages != WORLD]):
        arms = points[stages == body] - centres[body]
        turned = np.array([cross_matrix(arm) @ -shape[body, 3:] for arm in arms])
        size = max(size, float(np.linalg.norm(shape[body, :3] + turned, axis=1).max()))
    rotation = float(np.linalg.norm(shape[:, 3:], axis=1).max(initial=0.0))
    limits = [largest / size] if size > 0 else []
    limits += [_MAX_ROTATION_RAD / rotation] if rotation > 0 else []
    return min(limits, default=0.0)


def cycle(shape: Complex, frames: int) -> Real:
    """Return the motion of one cycle without its decay: Re(shape exp(i 2 pi k / frames)).

    Args:
        shape: any shape; (...).
        frames: number of instants of the cycle.

    Returns:
        The motion; (frames, ...).
    """
    turn = np.exp(2j * np.pi * np.arange(frames) / frames)
    return np.multiply.outer(turn, shape).real


def geometry_points(geometry: MachineGeometry, bodies: Sequence[str]) -> tuple[Real, Integers]:
    """Return all vertices of a machine's picture, and the number of the body of each.

    Args:
        bodies: names of the bodies, in the order of the motion.

    Returns:
        Points [m] (n, 3), and bodies, ``WORLD`` for those that stand still (n,).
    """
    number = {name: k for k, name in enumerate(bodies)}
    points = [surface.vertices for surface in geometry.surfaces]
    stages = [
        np.full(len(surface.vertices), number.get(surface.stage or "", WORLD), np.intp)
        for surface in geometry.surfaces
    ]
    for line in geometry.lines:
        points.append(line.points)
        stages.append(np.array([number.get(name or "", WORLD) for name in line.stages], np.intp))
    if not points:
        return np.zeros((0, 3)), np.zeros(0, np.intp)
    return np.vstack(points), np.concatenate(stages)
