"""Kinematics of a machine and the coefficients of its equation of motion, with changes of Parts."""

from collections.abc import Sequence

import numpy as np

from identification.words import Real
from mbmodel.assembly import add_product
from mbmodel.linearisation.gravity import gravity_slope, gravity_stiffness
from mbmodel.machine import Machine
from mbmodel.parts import Change


def nominal_coefficients(machine: Machine, jacobian: Real) -> Real:
    """Return the coefficients of bodies, gravity and what no Part changes.

    Args:
        machine: at its static equilibrium.
        jacobian: T; (6 n_body, nv).

    Returns:
        Coefficients of s^0, s^1, s^2; (3, nv, nv).
    """
    total = np.stack([machine.remaining_stiffness, machine.remaining_damping, machine.armature])
    total[2] += jacobian.T @ machine.body_mass @ jacobian
    if machine.gravity.any():
        weight_bearing_mass = machine.weight_fraction[:, None] * machine.body_mass
        total[0] += gravity_stiffness(
            machine.body_gravity, machine.precedence, jacobian, weight_bearing_mass
        )
    return total


def kinematics_and_coefficients(
    machine: Machine, as_drawn: Real, path: Sequence[Change], body: Sequence[Change]
) -> tuple[Real, Real]:
    """Return T, and the coefficients of bodies and gravity, with the changes of Parts.

    Args:
        machine: at its static equilibrium.
        as_drawn: coefficients without any Part; (3, nv, nv).
        path: changes of T.
        body: changes of Zb.
    """
    jacobian = machine.jacobian
    if not path:
        total = as_drawn.copy()
    else:
        jacobian = jacobian + sum(c.left @ c.core[0] @ c.right.T for c in path)
        total = nominal_coefficients(machine, jacobian)
    for change in body:
        left = jacobian.T @ change.left
        right = left if change.right is change.left else jacobian.T @ change.right
        add_product(total, left, change.core, right)
        if machine.gravity.any() and change.core[2].any():
            added = change.left @ change.core[2] @ change.right.T
            total[0] += gravity_slope(
                machine.body_gravity,
                machine.precedence,
                jacobian,
                machine.body_mass,
                inertia_change=machine.weight_fraction[:, None] * added,
            )
    return jacobian, total
