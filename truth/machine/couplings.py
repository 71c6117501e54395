r"""What a machine has beside the springs of its joints: tendons, weight, and all that remains.

Joint coordinates q are rows of the absolute coordinates x, q = S x. Whatever is known by them adds

    M += S^T M_q S,   C += S^T C_q S,   K += S^T K_q S.

The potential of the weights is V = -sum_i m_i g . c_i(q). Its second derivatives are exact: of two
coordinates a and b, the later b is turned by the earlier a if that is a hinge about w_a, so that

    d^2 c / dq_a dq_b = w_a x dc/dq_b,   and zero if a is a slide.
"""

from dataclasses import dataclass

import numpy as np

from truth.machine.dynamics import Flex, joint_rows
from truth.machine.station import GROUND, Joint, Real, Station


@dataclass(frozen=True, eq=False)
class CouplingMatrices:
    """M, C and K of the same coordinates; (n, n) each."""

    mass: Real
    damping: Real
    stiffness: Real


def coupled_matrices(station: Station, flexes: tuple[Flex, ...] = ()) -> CouplingMatrices:
    """Return what tendons, weights and the remaining forces add in absolute coordinates; (n, n)."""
    size = 6 * len(station.stages) + len(flexes)
    if station.remaining is None and not station.tendons and not station.gravity.any():
        return CouplingMatrices(*np.zeros((3, size, size)))
    moving = [joint_rows(station, index, flexes)[0] for index in range(len(station.stages))]
    rows: Real = np.vstack([np.zeros((0, size)), *moving])
    names = [joint.name for stage in station.stages for joint in stage.joints]
    mass, damping, stiffness = np.zeros((3, len(names), len(names)))
    stiffness += gravity_stiffness(station)
    for tendon in station.tendons:
        row = tendon.row(names)
        stiffness += tendon.stiffness * np.outer(row, row)
        damping += tendon.damping * np.outer(row, row)
    if station.remaining is not None:
        place = np.ix_(*[[names.index(name) for name in station.remaining.joints]] * 2)
        mass[place] += station.remaining.mass
        damping[place] += station.remaining.damping
        stiffness[place] += station.remaining.stiffness
    return CouplingMatrices(*(rows.T @ matrix @ rows for matrix in (mass, damping, stiffness)))


def tendon_rows(station: Station) -> Real:
    """Return how much each tendon is stretched by the absolute coordinates; (n_tendon, n)."""
    moving = [joint_rows(station, index)[0] for index in range(len(station.stages))]
    rows = np.vstack([np.zeros((0, 6 * len(station.stages))), *moving])
    names = [joint.name for stage in station.stages for joint in stage.joints]
    along = np.array([tendon.row(names) for tendon in station.tendons])
    return np.asarray(along.reshape(-1, len(names)) @ rows)


def gravity_stiffness(station: Station) -> Real:
    """Return the second derivatives of the weights' potential by the joint coordinates.

    Args:
        station: with its gravity; all joints in the order of the stages.

    Returns:
        [N/m, N, N m]; (n_joint, n_joint), symmetric.
    """
    joints = [joint for stage in station.stages for joint in stage.joints]
    first = np.cumsum([0, *(len(stage.joints) for stage in station.stages)]).tolist()
    stiffness = np.zeros((len(joints), len(joints)))
    if not station.gravity.any():
        return stiffness
    for index, stage in enumerate(station.stages):
        chain = [
            number
            for above in _path(station, index)
            for number in range(first[above], first[above + 1])
        ]
        for later, b in enumerate(chain):
            arm = _motion(joints[b], stage.com)
            for a in chain[: later + 1]:
                if joints[a].kind == "hinge":
                    bent = np.cross(joints[a].axis, arm)
                    value = -stage.mass * float(station.gravity @ bent)
                    stiffness[a, b] += value
                    stiffness[b, a] += value if a != b else 0.0
    return stiffness


def _motion(joint: Joint, point: Real) -> Real:
    """Return the motion of a point per unit of a joint below it; (3,)."""
    if joint.kind == "slide":
        return joint.axis
    return np.asarray(np.cross(joint.axis, point - joint.position))


def _path(station: Station, index: int) -> list[int]:
    """Return the stages from the ground to one, itself included."""
    path: list[int] = []
    while index != GROUND:
        path.insert(0, index)
        index = station.stages[index].parent
    return path
