"""Complex modes of M, C and K: poles and shapes of the quadratic eigenproblem."""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from identification.words import Complex, HasPoles, Real, shorten_names
from mbmodel.assembly import Matrices

_KERNEL_TOLERANCE = 1e-12  # of singular values, relative to the largest entry: rounding
_MAX_ASYMMETRY_OF_STIFFNESS = 1e-9  # of the largest entry: larger is no rounding


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
    """
    stiffness = matrices.stiffness
    if (
        np.abs(stiffness - stiffness.T).max()
        > _MAX_ASYMMETRY_OF_STIFFNESS * np.abs(stiffness).max()
    ):
        return _modes_of_unsymmetric(matrices)
    mass, damping = matrices.mass, matrices.damping
    resting = rest_motions(stiffness, mass)
    undamped = resting @ _kernel(np.vstack([damping @ resting, damping.T @ resting]), damping)
    damped = _complement(resting, undamped, mass)
    springy = _complement(np.eye(len(mass)), resting, mass)
    poles, shapes = _solve_state(matrices, springy, damped)
    order = np.argsort(np.abs(poles))
    count = resting.shape[1]
    return Modes(
        np.concatenate([np.zeros(count), poles[order]]),
        normalise_shapes(np.hstack([resting, shapes[:, order]]), mass),
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
    shapes = normalise_shapes(root @ vectors[:size, keep], matrices.mass)
    return Modes(poles[keep].astype(complex), shapes, ("",) * len(keep))


def rest_motions(stiffness: Real, mass: Real) -> Real:
    """Return M-orthonormal motions that no spring resists; (nv, n_rest).

    Rows and columns are scaled to their largest entry first, so that a soft spring beside stiff
    ones still counts as a spring.
    """
    largest = np.abs(stiffness).max(axis=1)
    scale = 1.0 / np.sqrt(np.where(largest > 0, largest, 1.0))
    motions = scale[:, None] * _kernel(scale[:, None] * stiffness * scale, np.ones(1))
    return _orthonormal(motions, mass)


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
    return rows[values <= _KERNEL_TOLERANCE * max(float(np.abs(size).max()), 1e-300)].T


def _orthonormal(motions: Real, mass: Real) -> Real:
    """Return an M-orthonormal basis of motions."""
    if not motions.shape[1]:
        return motions
    root = np.linalg.cholesky(motions.T @ mass @ motions)
    return np.linalg.solve(root, motions.T).T


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


def normalise_shapes(shapes: Complex, mass: Real) -> Complex:
    """Scale shapes to unit modal mass, phi' M phi real, largest entry with positive real part."""
    if not shapes.size:
        return shapes.astype(complex)
    momentum = mass @ shapes
    size = (shapes.conj() * momentum).sum(axis=0).real
    phase: Real = np.angle((shapes * momentum).sum(axis=0))
    shapes = shapes * (np.cos(phase / 2) - 1j * np.sin(phase / 2)) / np.sqrt(size)
    largest = shapes[np.abs(shapes).argmax(axis=0), np.arange(shapes.shape[1])]
    return shapes * np.where(largest.real < 0, -1.0, 1.0)
