"""Mode shapes of two machines as motions of the bodies that both have."""

from collections.abc import Sequence

import numpy as np

from identification.words import Complex
from mbmodel.machine import Machine
from mbmodel.modes.matrix_modes import Modes
from mbmodel.spatial import transport


def weighted_motions(
    machine: Machine, modes: Modes, bodies: Sequence[str], weights: Machine
) -> Complex:
    """Return mode shapes as motions of some bodies, weighted by the square root of their mass.

    The motions are those at the centres of mass of the machine that weighs, since an added mass
    moves the centre. With W'W = Mb the mass matrix of the bodies, a^H b of two weighted shapes is
    phi_a^H Mb phi_b. The MAC of weighted shapes thus is the normalised cross-orthogonality (Ewins
    2000, ch. 5): translations in m and rotations in rad count by the energy that they carry.

    Args:
        machine: whose modes they are.
        modes: of the machine.
        bodies: names of bodies of both machines.
        weights: machine whose masses weigh.

    Returns:
        W T phi; (6 n_bodies, n_mode).
    """
    rows = []
    for body in bodies:
        number, weighing = machine.layout.bodies.index(body), weights.layout.bodies.index(body)
        arm = weights.layout.centres[weighing] - machine.layout.centres[number]
        mass = weights.body_mass[6 * weighing :][:6, 6 * weighing :][:, :6]
        motion = transport(arm) @ machine.jacobian[6 * number :][:6]
        rows.append(np.linalg.cholesky(mass).T @ motion @ modes.shapes)
    motions: Complex = np.concatenate(rows)
    return motions
