"""Modes of a linearised model, with control loops closed, and names of motions at rest."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.linalg
from scipy.sparse.csgraph import connected_components

from identification.words import DIRECTIONS, Complex, Mask, Output, Real
from mbmodel.assembly import Assembly
from mbmodel.machine import Machine
from mbmodel.model import Model
from mbmodel.modes.closed_loop_modes import modes_of_assembly
from mbmodel.modes.matrix_modes import Modes, normalise_shapes
from mbmodel.ports.ports import apply_point_changes, find_ports
from mbmodel.spatial import transport

# Relative M-norm: a closer motion lies in the span of the motions at rest.
_MAX_DISTANCE_FROM_REST = 1e-6


def model_modes(model: Model, theta: Real) -> Modes:
    """Return the modes of a model at theta, with names for the motions at rest.

    Control loops of the machine are closed; other laws that are no polynomials in s are left out.

    Motions at rest are given in pure form where possible. ``rigid tx`` .. ``rigid rz`` move the
    whole machine along an axis, or about one through its centre of mass (``rigid tx of <body>``
    if there are several machines); ``free <joint>`` moves one coordinate. Other motions are named
    after their largest coordinates.

    Args:
        model: machine and Parts.
        theta: parameters in SI; (n_parameter,).
    """
    assembly = model.assemble(theta)
    modes = modes_of_assembly(assembly)
    count = sum(1 for name in modes.names if name)
    if not count:
        return modes
    names, motions = _name_rest_motions(assembly, modes.shapes[:, :count].real)
    pure = normalise_shapes(motions.astype(complex), assembly.matrices.mass)
    shapes = np.hstack([pure, modes.shapes[:, count:]])
    return replace(modes, shapes=shapes, names=(*names, *modes.names[count:]))


def _name_rest_motions(assembly: Assembly, resting: Real) -> tuple[list[str], Real]:
    """Return names and motions that span those at rest; (nv, n_rest).

    Args:
        assembly: the equation at theta.
        resting: M-orthonormal motions at rest; (nv, n_rest).
    """
    machine, mass = assembly.machine, assembly.matrices.mass
    names: list[str] = []
    motions: list[Real] = []
    remaining = resting
    candidates = [*_rigid_candidates(assembly), *_coordinate_candidates(assembly)]
    for name, motion in candidates:
        within = resting @ (resting.T @ mass @ motion)
        size = np.sqrt(motion @ mass @ motion)
        outside = motion - within
        new = remaining @ (remaining.T @ mass @ motion)
        if (
            np.sqrt(outside @ mass @ outside) <= _MAX_DISTANCE_FROM_REST * size
            and float(new @ mass @ new) > 1e-6 * size**2
        ):
            names.append(name)
            motions.append(motion)
            remaining = _remove_direction(remaining, new, mass)
    for motion in remaining.T:
        main = np.argsort(-np.abs(motion))[:3]
        strong = sorted(k for k in main if abs(motion[k]) > 0.1 * abs(motion[main[0]]))
        names.append("free " + " with ".join(machine.coordinates[k] for k in strong))
        motions.append(motion)
    return names, np.array(motions).T


def _rigid_candidates(assembly: Assembly) -> list[tuple[str, Real]]:
    """Return the rigid motions of each group of connected bodies, if the joints allow them."""
    machine, jacobian = assembly.machine, assembly.jacobian
    masses = np.diag(assembly.body[2])[::6]
    groups = _connected_bodies(assembly)
    candidates = []
    for members in groups:
        centre = masses[members] @ machine.layout.centres[members] / masses[members].sum()
        rigid = (machine.floor_jacobian @ transport(-centre)).reshape(len(masses), 6, 6)
        rigid[~members] = 0.0
        suffix = f" of {machine.layout.bodies[int(np.argmax(members))]}" if len(groups) > 1 else ""
        for direction, motion in zip(DIRECTIONS, rigid.reshape(-1, 6).T, strict=True):
            joint = np.asarray(np.linalg.lstsq(jacobian, motion, rcond=None)[0], np.float64)
            if np.linalg.norm(
                jacobian @ joint - motion
            ) <= _MAX_DISTANCE_FROM_REST * np.linalg.norm(motion):
                candidates.append((f"rigid {direction}{suffix}", joint))
    return candidates


def _connected_bodies(assembly: Assembly) -> list[Mask]:
    """Return groups of bodies that share a joint coordinate or a spring; (n_body,) each."""
    size = len(assembly.jacobian) // 6
    moved = assembly.jacobian.reshape(size, 6, -1).any(axis=1)
    reach = moved.astype(float)
    springs = (assembly.matrices.stiffness != 0).astype(float)
    tied = reach @ (springs + np.eye(len(springs))) @ reach.T
    count, labels = connected_components(tied > 0, directed=False)
    return [labels == k for k in range(count)]


def _coordinate_candidates(assembly: Assembly) -> list[tuple[str, Real]]:
    """Return the motion of each single coordinate."""
    names = assembly.machine.coordinates
    return [(f"free {name}", row) for name, row in zip(names, np.eye(len(names)), strict=True)]


def _remove_direction(basis: Real, motion: Real, mass: Real) -> Real:
    """Return an M-orthonormal basis without one direction of its span."""
    weights = basis.T @ mass @ motion
    rest = scipy.linalg.null_space(weights[None] / np.linalg.norm(weights))
    smaller: Real = basis @ rest
    return smaller


def shapes_at(model: Model, theta: Real, modes: Modes, outputs: Sequence[Output]) -> Complex:
    """Return the motion at sensors or centres of mass in each mode, L T phi; (n_out, n_mode).

    Args:
        model: machine and Parts.
        theta: parameters in SI; (n_parameter,).
        modes: of the model at theta.
        outputs: labels of sensors, points or bodies.

    Raises:
        UsageError: a label that the machine does not have.
    """
    assembly = model.assemble(theta)
    ports = find_ports(model.machine, outputs, ())
    ports = apply_point_changes(ports, assembly.point_changes, outputs, ())
    readout = ports.readout @ assembly.jacobian + ports.joint_readout
    shapes: Complex = readout @ modes.shapes
    return shapes


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
