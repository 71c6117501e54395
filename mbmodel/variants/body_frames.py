"""Motion of the bodies of a variant by that of the nominal machine's reference points.

A variant has centres of mass of its own, and its bodies may stand elsewhere and be turned. With R
the rotation of a body from the nominal machine to the variant, c' its centre of mass there, and p
the nominal centre of mass carried along with the body, a motion (v, w) about c' in world axes is

    A (v, w),    A = [[R', 0], [0, R']] [[1, -[p - c']x], [0, 1]]

about p in the axes that turned with the body, in which Parts of the nominal machine are written.
Their forces become A' times themselves.
"""

import numpy as np
from scipy.linalg import block_diag

from identification.words import Real
from mbmodel.machine import Machine
from mbmodel.spatial import transport


def body_rotations(machine: Machine, variant: Machine) -> dict[str, Real]:
    """Return the rotation of each drawn body from a machine to its variant; (3, 3) each.

    Args:
        machine: nominal machine.
        variant: with the same bodies.
    """
    return {
        name: variant.drawing.bodies[name].frame @ machine.drawing.bodies[name].frame.T
        for name in machine.layout.bodies
        if name in machine.drawing.bodies
    }


def motion_to_nominal(machine: Machine, variant: Machine) -> Real:
    """Return A of all bodies; (6 n_body, 6 n_body). Bodies that the drawing lacks keep theirs.

    Args:
        machine: nominal machine.
        variant: with the same bodies in the same order.
    """
    rotations, blocks = body_rotations(machine, variant), []
    for number, name in enumerate(machine.layout.bodies):
        if name not in rotations:
            blocks.append(np.eye(6))
            continue
        turn = rotations[name]
        nominal, moved = machine.drawing.bodies[name], variant.drawing.bodies[name]
        arm = turn @ (machine.layout.centres[number] - nominal.origin)
        point = moved.origin + arm
        turned = np.kron(np.eye(2), turn.T)
        blocks.append(turned @ transport(point - variant.layout.centres[number]))
    matrix: Real = block_diag(*blocks)
    return matrix
