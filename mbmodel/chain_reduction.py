"""A machine with closed chains as an ordinary machine of fewer coordinates.

Every term of the equation of motion is projected on N (``mbmodel.linearisation.closed_chains``).
Each spring, weight and other force r keeps its own share -r.Q of the geometric stiffness, so that
derivatives by stiffness and mass are exact at the pose. What comes later sees no chain.
"""

from dataclasses import replace

import numpy as np

from identification.words import InputError, Real
from mbmodel.linearisation.closed_chains import Chains
from mbmodel.linearisation.springs import Spring
from mbmodel.linearisation.tendon_slopes import tendon_elongation
from mbmodel.machine import Axle, Machine
from mbmodel.mjcf.names import joint_coordinate


def reduce_machine(machine: Machine, chains: Chains, remaining_force: Real) -> Machine:
    """Return a machine whose chains are closed, in the coordinates that are kept.

    Args:
        machine: in all joint coordinates; its sensors are those of the closed chains already.
        chains: at its equilibrium.
        remaining_force: at rest beside gravity and linear springs [N, N m]; (nv,).

    Raises:
        InputError: a hinge of a chain spins.
    """
    kept = chains.kept
    count = len(kept)
    elongations = _elongations(chains)
    return replace(
        machine,
        coordinates=tuple(machine.coordinates[k] for k in kept),
        jacobian=machine.jacobian @ chains.basis,
        armature=chains.matrix(machine.armature),
        springs=tuple(
            _reduce_spring(spring, chains, elongation)
            for spring, elongation in zip(machine.springs, elongations, strict=True)
        ),
        remaining_stiffness=chains.matrix(machine.remaining_stiffness, remaining_force),
        remaining_damping=chains.matrix(machine.remaining_damping),
        precedence=np.full((count, count), 0.5),
        curvature=_body_curvature(machine, chains),
        axles=tuple(_reduce_axle(axle, chains) for axle in machine.axles),
        motors={
            name: replace(gain, joint=chains.force(gain.joint))
            for name, gain in machine.motors.items()
        },
        tree=machine,
    )


def _elongations(chains: Chains) -> Real:
    """Return how far each spring is stretched at rest, in the order of the machine's springs."""
    model, data = chains.model, chains.data
    joints = model.dof_jntid
    addresses = model.jnt_qposadr[joints]
    stretched = np.where(
        model.jnt_stiffness[joints] > 0, (data.qpos - model.qpos_spring)[addresses], 0.0
    )
    return np.concatenate([stretched, tendon_elongation(model, data)])


def _reduce_spring(spring: Spring, chains: Chains, elongation: float) -> Spring:
    """Return a spring in kept coordinates; what it carries at rest stiffens it geometrically."""
    moved = np.flatnonzero(spring.direction)
    curved = elongation * np.tensordot(spring.direction[moved], chains.bending[moved], 1)
    if spring.geometric is not None:
        curved = curved + chains.matrix(spring.geometric)
    return replace(
        spring,
        direction=chains.force(spring.direction),
        geometric=curved if curved.any() else None,
    )


def _reduce_axle(axle: Axle, chains: Chains) -> Axle:
    """Return a slide or hinge with its motion per kept coordinate, if a chain holds it."""
    coordinate = axle.coordinate
    places = np.flatnonzero(chains.kept == coordinate)
    place = int(places[0]) if places.size else -1
    if place >= 0 and not chains.closure.rows[:, coordinate].any():
        return replace(axle, coordinate=place)
    return replace(axle, coordinate=place, chain_row=chains.basis[coordinate])


def _body_curvature(machine: Machine, chains: Chains) -> Real:
    """Return B in kept coordinates: of joints that follow one another, and of N; (6 n_body, n, n).

    Of coordinates i before j the earlier turns the motion (v_j, w_j) of a centre of mass. With the
    precedence P this is beyond the mean of both orders by

        (P_ij - 1/2) (w_i x v_j + v_i x w_j, w_i x w_j).
    """
    jacobian, basis = machine.jacobian, chains.basis
    bending, count = chains.bending, len(chains.kept)
    curvature = np.zeros((len(jacobian), count, count))
    order = machine.precedence - 0.5
    for first in range(0, len(jacobian), 6):
        block = jacobian[first : first + 6]
        below = np.flatnonzero(block.any(axis=0))
        led = np.intersect1d(below, chains.following)
        curvature[first : first + 6] = np.tensordot(block[:, led], bending[led], 1)
        moved, turned = block[:3, below].T, block[3:, below].T
        between = np.cross(turned[:, None], moved[None]) + np.cross(moved[:, None], turned[None])
        both = np.concatenate([between, np.cross(turned[:, None], turned[None])], axis=2)
        curvature[first : first + 6] += np.einsum(
            "ia,ijd,jb->dab",
            basis[below],
            order[np.ix_(below, below)][:, :, None] * both,
            basis[below],
            optimize=True,
        )
    return curvature


def refuse_spinning_chain(machine: Machine, chains: Chains, spin: list[str]) -> None:
    """Refuse a hinge of a chain that spins.

    Args:
        spin: names of the spinning hinges.
    """
    for name in spin:
        if chains.closure.rows[:, joint_coordinate(chains.model, name)].any():
            raise InputError(
                f"{machine.source}: joint {name!r} spins in a closed chain, which would move all "
                "of it: let a hinge outside of the chain spin"
            )
