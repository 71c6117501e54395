"""Complex modes of a linearised model: poles, shapes, and names of motions at rest."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from scipy.sparse.csgraph import connected_components

from identification.words import (
    DIRECTIONS,
    Complex,
    HasPoles,
    Mask,
    Output,
    Real,
    shorten_names,
)
from mbmodel.assembly import Assembly, Matrices
from mbmodel.frf.ports import apply_point_changes, find_ports
from mbmodel.model import Model
from mbmodel.spatial import transport

_KERNEL_TOLERANCE = 1e-12  # of singular values, relative to the largest entry: rounding
_MAX_ASYMMETRY_OF_STIFFNESS = 1e-9  # of the largest entry: larger is no rounding
# Relative M-norm: a closer motion lies in the span of the motions at rest.
_MAX_DISTANCE_FROM_REST = 1e-6


@dataclass(frozen=True, eq=False)
class Modes(HasPoles):
    """Eigenvalues of the equation of motion, one of each conjugate pair, by rising frequency.

    Motions that no spring resists ("at rest") come first, at s = 0.

    Args:
        poles: s_r = w_r (-zeta_r + i sqrt(1 - zeta_r^2)) (seed, eq. 3.4) [rad/s]; (n_mode,).
        shapes: phi_r in joint coordinates, of unit modal mass |phi^H M phi| = 1, turned in phase
            so that phi' M phi is real; (nv, n_mode).
        names: of motions at rest, such as ``rigid tx`` or ``free spindle_rz``; else empty.
    """

    poles: Complex
    shapes: Complex
    names: tuple[str, ...]

    def __repr__(self) -> str:
        """Return the natural frequencies in one line."""
        listed = shorten_names([f"{value:.4g}" for value in self.freq_hz])
        return f"{len(self.poles)} modes at {listed} Hz"

    @property
    def oscillates(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Whether each mode is a pair: neither overdamped nor at rest; (n_mode,)."""
        return self.poles.imag > 0


def modes_of_matrices(matrices: Matrices) -> Modes:
    """Solve the quadratic eigenproblem (s^2 M + s C + K) phi = 0.

    Each coordinate has two poles. Oscillating poles count once a pair; real poles (overdamped or
    unstable) are listed singly, and a motion at rest once. In modal coordinates of (M, K) the state
    matrix is nearly skew-symmetric (see ``mbmodel.frf.modal_form``). Motions without stiffness are
    removed first, since rounding would split their double zero by its square root.

    Args:
        matrices: M, C, K.
    """
    stiffness = matrices.stiffness
    if (
        np.abs(stiffness - stiffness.T).max()
        > _MAX_ASYMMETRY_OF_STIFFNESS * np.abs(stiffness).max()
    ):
        return _modes_of_unsymmetric(matrices)
    mass, damping = matrices.mass, matrices.damping
    resting = _rest_motions(stiffness, mass)
    undamped = resting @ _kernel(np.vstack([damping @ resting, damping.T @ resting]), damping)
    damped = _complement(resting, undamped, mass)
    springy = _complement(np.eye(len(mass)), resting, mass)
    poles, shapes = _solve_state(matrices, springy, damped)
    order = np.argsort(np.abs(poles))
    count = resting.shape[1]
    return Modes(
        np.concatenate([np.zeros(count), poles[order]]),
        _normalise(np.hstack([resting, shapes[:, order]]), mass),
        tuple(f"at rest {k + 1}" for k in range(count)) + ("",) * len(poles),
    )


def _modes_of_unsymmetric(matrices: Matrices) -> Modes:
    """Return modes for a stiffness without symmetry, as of centrifugal or follower forces."""
    size = len(matrices.mass)
    root = np.linalg.inv(scipy.linalg.cholesky(matrices.mass))
    stiffness, damping = (root.T @ a @ root for a in (matrices.stiffness, matrices.damping))
    unit = float(np.sqrt(np.linalg.norm(stiffness, 2)))
    state = np.block([[np.zeros((size, size)), unit * np.eye(size)], [-stiffness / unit, -damping]])
    poles, vectors = np.linalg.eig(state)
    keep = np.flatnonzero(poles.imag >= 0)
    keep = keep[np.argsort(np.abs(poles[keep]))]
    shapes = _normalise(root @ vectors[:size, keep], matrices.mass)
    return Modes(poles[keep].astype(complex), shapes, ("",) * len(keep))


def _rest_motions(stiffness: Real, mass: Real) -> Real:
    """Return M-orthonormal motions that no spring resists; (nv, n_rest).

    Rows and columns are scaled to their largest entry first, so that a soft spring beside stiff
    ones still counts as a spring.
    """
    largest = np.abs(stiffness).max(axis=1)
    scale = 1.0 / np.sqrt(np.where(largest > 0, largest, 1.0))
    kernel = scale[:, None] * _kernel(scale[:, None] * stiffness * scale, np.ones(1))
    return _orthonormal(kernel, mass)


def _kernel(matrix: Real, size: Real) -> Real:
    """Return directions that a matrix takes to zero but for rounding; (n, n_kernel), orthonormal.

    Args:
        matrix: (m, n).
        size: its scale: the largest entry counts.
    """
    if not matrix.shape[1]:
        return np.zeros((0, 0))
    _, values, rows = np.linalg.svd(matrix)
    values = np.append(values, np.zeros(matrix.shape[1] - len(values)))
    kernel: Real = rows[values <= _KERNEL_TOLERANCE * max(float(np.abs(size).max()), 1e-300)].T
    return kernel


def _orthonormal(motions: Real, mass: Real) -> Real:
    """Return an M-orthonormal basis of motions."""
    if not motions.shape[1]:
        return motions
    root = np.linalg.cholesky(motions.T @ mass @ motions)
    basis: Real = np.linalg.solve(root, motions.T).T
    return basis


def _complement(motions: Real, excluded: Real, mass: Real) -> Real:
    """Return an M-orthonormal basis of the part of a span that is M-orthogonal to others."""
    inner = (
        motions if not excluded.shape[1] else motions @ _kernel(excluded.T @ mass @ motions, mass)
    )
    return _orthonormal(inner, mass)


def _solve_state(matrices: Matrices, springy: Real, damped: Real) -> tuple[Complex, Complex]:
    """Return poles with Im >= 0 and their shapes.

    The state is (w z, z') of the modal coordinates z with springs, and the velocities of the damped
    motions without springs, whose positions no force feels.

    Args:
        matrices: M, C, K.
        springy: motions with stiffness, M-orthonormal; (nv, n).
        damped: motions without stiffness that are damped; (nv, m).
    """
    squares, turn = np.linalg.eigh(springy.T @ matrices.stiffness @ springy)
    basis = np.hstack([springy @ turn, damped])
    frequency, size = np.sqrt(np.abs(squares)), len(squares)
    state = np.zeros((size + basis.shape[1],) * 2)
    diagonal = np.arange(size)
    state[diagonal, size + diagonal] = frequency
    state[size + diagonal, diagonal] = -np.sign(squares) * frequency
    state[size:, size:] = -basis.T @ matrices.damping @ basis
    poles, vectors = np.linalg.eig(state)
    keep = poles.imag >= 0
    poles, vectors = poles[keep].astype(complex), vectors[:, keep]
    moving = np.where(poles == 0, 1.0, poles)
    return poles, np.asarray(basis @ (vectors[size:] / moving), np.complex128)


def _normalise(shapes: Complex, mass: Real) -> Complex:
    """Scale shapes to unit modal mass, phi' M phi real, largest entry with positive real part."""
    if not shapes.size:
        return shapes.astype(complex)
    momentum = mass @ shapes
    size = (shapes.conj() * momentum).sum(axis=0).real
    phase: Real = np.angle((shapes * momentum).sum(axis=0))
    shapes = shapes * (np.cos(phase / 2) - 1j * np.sin(phase / 2)) / np.sqrt(size)
    largest = shapes[np.abs(shapes).argmax(axis=0), np.arange(shapes.shape[1])]
    flipped: Complex = shapes * np.where(largest.real < 0, -1.0, 1.0)
    return flipped


def model_modes(model: Model, theta: Real) -> Modes:
    """Return the modes of a model at theta, with names for the motions at rest.

    Motions at rest are given in pure form where possible. ``rigid tx`` .. ``rigid rz`` move the
    whole machine along an axis, or about one through its centre of mass (``rigid tx of <body>``
    if there are several machines); ``free <joint>`` moves one coordinate. Other motions are named
    after their largest coordinates.

    Args:
        model: machine and Parts.
        theta: parameters in SI; (n_parameter,).
    """
    assembly = model.assemble(theta)
    modes = modes_of_matrices(assembly.matrices)
    count = sum(1 for name in modes.names if name)
    if not count:
        return modes
    names, motions = _name_rest_motions(assembly, modes.shapes[:, :count].real)
    pure = _normalise(motions.astype(complex), assembly.matrices.mass)
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
