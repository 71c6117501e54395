"""Modes of a linearised model, with control loops closed, and names of motions at rest.

Modes of a machine with laws that are no polynomials in s: losses, delays, relaxation.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.linalg
from scipy.sparse.csgraph import connected_components

from identification.words import DIRECTIONS, Complex, ConvergenceError, Integers, Mask, Output, Real
from mbmodel.assembly import Assembly
from mbmodel.machine import Machine
from mbmodel.model import Model
from mbmodel.modes.closed_loop_modes import (
    LawProblem,
    modes_of_assembly,
    normalise_shape,
    solve_pole,
)
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
    return basis @ rest


def shapes_at(model: Model, theta: Real, modes: Modes, outputs: Sequence[Output]) -> Complex:
    """Return the motion at sensors or centres of mass in each mode, L T phi; (n_out, n_mode).

    Args:
        theta: parameters in SI; (n_parameter,).
        outputs: labels of sensors, points or bodies.

    Raises:
        UsageError: a label that the machine does not have.
    """
    assembly = model.assemble(theta)
    ports = find_ports(model.machine, outputs, ())
    ports = apply_point_changes(ports, assembly.point_changes, outputs, ())
    readout = ports.readout @ assembly.jacobian + ports.joint_readout
    return readout @ modes.shapes


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
    return np.concatenate(rows)


# Growth of the laws in one step, and the MAC that a mode must keep over it: first coarse, then fine
# where two modes have met.
_STEPS_AND_MACS = ((1 / 8, 0.8), (1 / 64, 0.95), (1 / 512, 0.99))
_MIN_STEP = 2.0**-16  # of the growth: a mode that needs smaller ones ends, such as on the real axis
_MAX_TRAVEL = 0.2  # of a pole in one step, relative
_MIN_DISTANCE = 1e-6  # of two poles, relative: nearer ones are one mode found twice


def modes_with_laws(model: Model, theta: Real) -> Modes:
    """Return the modes of Z(s) phi = 0 with all laws.

    Each oscillating mode of M, C and K, with control loops closed, is followed by Newton's method
    while the laws grow to their size (Ruhe 1973), in steps over which its shape hardly changes.
    Poles on the real axis are those of M, C and K, and so are all modes of a machine without such
    laws. A measured rest is known on its lines alone, and does not count.

    Args:
        theta: parameters in SI; (n_parameter,).

    Raises:
        ConvergenceError: a mode that cannot be followed.
    """
    model = replace(model, machine=replace(model.machine, rest=None))
    modes, assembly = model_modes(model, theta), model.assemble(theta)
    terms = assembly.frequency_dependent
    laws = tuple(term for term in terms if not term.is_loop)
    if not laws:
        return modes
    loops = tuple(term for term in terms if term.is_loop)
    problem = LawProblem(assembly.matrices, laws, loops)
    poles, shapes = modes.poles.copy(), modes.shapes.copy()
    pending = np.flatnonzero(modes.oscillates)
    for step, min_mac in _STEPS_AND_MACS:
        for number in pending:
            poles[number], shapes[:, number] = _follow(
                problem, complex(modes.poles[number]), modes.shapes[:, number], step, min_mac
            )
        pending = _find_doubles(poles, np.flatnonzero(modes.oscillates))
        if not len(pending):
            break
    if len(pending):
        raise ConvergenceError(_sentence(complex(modes.poles[pending[0]])))
    mass = assembly.matrices.mass
    for number in np.flatnonzero(modes.oscillates):
        shapes[:, number] = normalise_shape(shapes[:, number], mass)
    order = np.argsort(np.abs(poles), kind="stable")
    names = tuple(modes.names[k] for k in order)
    return replace(modes, poles=poles[order], shapes=shapes[:, order], names=names)


def _find_doubles(poles: Complex, chosen: Integers) -> Integers:
    """Return the numbers of modes whose pole another one has too."""
    distance = np.abs(poles[chosen, None] - poles[chosen]) + np.diag(np.full(len(chosen), np.inf))
    return chosen[distance.min(axis=1) < _MIN_DISTANCE * np.abs(poles[chosen])]


def _sentence(pole: complex) -> str:
    return (
        f"the mode near {abs(pole) / (2 * np.pi):.4g} Hz cannot be followed with the loss factors, "
        "delays and Maxwell branches: make them smaller"
    )


def _follow(
    problem: LawProblem, pole: complex, shape: Complex, step: float, min_mac: float
) -> tuple[complex, Complex]:
    """Return pole and shape with the laws, from those without.

    Args:
        pole: of the mode without laws.
        shape: of it; (nv,).
        step: largest growth of the laws at once.
        min_mac: least MAC of the shape over a step.
    """
    share, start = 0.0, pole
    while share < 1:
        size = min(step, 1 - share)
        solution = solve_pole(problem, share + size, pole, shape)
        if solution is None or not _is_near(problem, (pole, shape), solution, min_mac):
            step = size / 2
            if step < _MIN_STEP:
                raise ConvergenceError(_sentence(start))
            continue
        pole, shape = solution
        share += size
    return pole, shape


def _is_near(
    problem: LawProblem,
    before: tuple[complex, Complex],
    after: tuple[complex, Complex],
    min_mac: float,
) -> bool:
    """Return whether a mode has moved little over a step."""
    mass = problem.matrices.mass
    (pole, shape), (moved, turned) = before, after
    product = abs(np.vdot(shape, mass @ turned)) ** 2
    sizes = abs(np.vdot(shape, mass @ shape)) * abs(np.vdot(turned, mass @ turned))
    is_near = abs(moved - pole) <= _MAX_TRAVEL * abs(pole) and moved.imag > 0
    return bool(is_near and product >= min_mac * sizes)
