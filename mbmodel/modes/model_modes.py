"""Complex modes of a linearised model: poles, shapes, and rigid motions by name."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from scipy.sparse.csgraph import connected_components

from identification.words import DIRECTIONS, Complex, Dof, HasPoles, Mask, Real
from mbmodel.frf.ports import changed, places
from mbmodel.model import Assembly, Matrices, Model
from mbmodel.spatial import transport

_ROUNDING = 1e-12  # of a matrix's entries, relative to the largest of its row
_SYMMETRY = 1e-9
_SAME = 1e-6  # relative distance of a motion from the motions at rest


@dataclass(frozen=True, eq=False)
class Modes(HasPoles):
    """Eigenvalues of the equation of motion, one of each conjugate pair, by rising frequency.

    Motions that no spring resists come first, at s = 0.

    Args:
        poles: s_r = w_r (-zeta_r + i sqrt(1 - zeta_r^2)) (seed, eq. 3.4) [rad/s]; (n_mode,).
        shapes: phi_r in joint coordinates, of unit modal mass |phi^H M phi| = 1, turned in phase
            so that phi' M phi is real; (nv, n_mode).
        names: of motions at rest, such as ``rigid tx`` or ``free spindle_rz``; else empty.
    """

    poles: Complex
    shapes: Complex
    names: tuple[str, ...]

    @property
    def oscillates(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Which are pairs: not overdamped and not at rest; (n_mode,)."""
        return self.poles.imag > 0


def modes_of_matrices(matrices: Matrices) -> Modes:
    """Solve the quadratic eigenproblem (s^2 M + s C + K) phi = 0.

    Two poles stand for each coordinate. Oscillating poles count once a pair; real poles
    (overdamped, or unstable) are listed singly, and a motion at rest once. In modal coordinates of
    (M, K) the state matrix is nearly skew (see ``modal``); motions without stiffness are taken out
    first, since their double zero would split by the root of the rounding.
    """
    stiffness = matrices.stiffness
    if np.abs(stiffness - stiffness.T).max() > _SYMMETRY * np.abs(stiffness).max():
        return _unsymmetric(matrices)
    mass, damping = matrices.mass, matrices.damping
    resting = _at_rest(stiffness, mass)
    undamped = resting @ _kernel(np.vstack([damping @ resting, damping.T @ resting]), damping)
    damped = _beside(resting, undamped, mass)
    springy = _beside(np.eye(len(mass)), resting, mass)
    poles, shapes = _solve(matrices, springy, damped)
    order = np.argsort(np.abs(poles))
    count = resting.shape[1]
    return Modes(
        np.concatenate([np.zeros(count), poles[order]]),
        _normalised(np.hstack([resting, shapes[:, order]]), mass),
        tuple(f"at rest {k + 1}" for k in range(count)) + ("",) * len(poles),
    )


def _unsymmetric(matrices: Matrices) -> Modes:
    """Modes where the stiffness has no symmetry, as of centrifugal or follower forces."""
    size = len(matrices.mass)
    root = np.linalg.inv(scipy.linalg.cholesky(matrices.mass))
    stiffness, damping = (root.T @ a @ root for a in (matrices.stiffness, matrices.damping))
    unit = float(np.sqrt(np.linalg.norm(stiffness, 2)))
    state = np.block([[np.zeros((size, size)), unit * np.eye(size)], [-stiffness / unit, -damping]])
    poles, vectors = np.linalg.eig(state)
    keep = np.flatnonzero(poles.imag >= 0)
    keep = keep[np.argsort(np.abs(poles[keep]))]
    shapes = _normalised(root @ vectors[:size, keep], matrices.mass)
    return Modes(poles[keep].astype(complex), shapes, ("",) * len(keep))


def _at_rest(stiffness: Real, mass: Real) -> Real:
    """M-orthonormal motions that no spring resists; (nv, n_rest).

    Rows and columns are scaled to their largest entry first, so that a soft spring beside stiff
    ones still counts as one.
    """
    largest = np.abs(stiffness).max(axis=1)
    scale = 1.0 / np.sqrt(np.where(largest > 0, largest, 1.0))
    kernel = scale[:, None] * _kernel(scale[:, None] * stiffness * scale, np.ones(1))
    return _orthonormal(kernel, mass)


def _kernel(matrix: Real, size: Real) -> Real:
    """Directions that a matrix takes to zero but for rounding; (n, n_kernel), orthonormal."""
    if not matrix.shape[1]:
        return np.zeros((0, 0))
    _, values, rows = np.linalg.svd(matrix)
    values = np.append(values, np.zeros(matrix.shape[1] - len(values)))
    kernel: Real = rows[values <= _ROUNDING * max(float(np.abs(size).max()), 1e-300)].T
    return kernel


def _orthonormal(motions: Real, mass: Real) -> Real:
    if not motions.shape[1]:
        return motions
    root = np.linalg.cholesky(motions.T @ mass @ motions)
    basis: Real = np.linalg.solve(root, motions.T).T
    return basis


def _beside(motions: Real, taken: Real, mass: Real) -> Real:
    """M-orthonormal basis of what some motions span beside those taken."""
    inner = motions if not taken.shape[1] else motions @ _kernel(taken.T @ mass @ motions, mass)
    return _orthonormal(inner, mass)


def _solve(matrices: Matrices, springy: Real, damped: Real) -> tuple[Complex, Complex]:
    """Poles with Im >= 0 and their shapes: springy motions, and damped ones without springs.

    The state is (w z, z') of the springy modal coordinates z and the velocities of the damped
    ones, whose positions no force feels.
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


def _normalised(shapes: Complex, mass: Real) -> Complex:
    """Unit modal mass, phi' M phi real, the largest entry with a positive real part."""
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
    """Modes of a model at theta, motions at rest named and given in pure form.

    ``rigid tx`` .. ``rigid rz``: the whole machine along an axis, or about one through its centre
    of mass (``rigid tx of <body>`` where there are several); ``free <joint>``: one coordinate; the
    rest by their largest coordinates.
    """
    assembly = model.assemble(theta)
    found = modes_of_matrices(assembly.matrices)
    count = sum(1 for name in found.names if name)
    if not count:
        return found
    names, motions = _named(assembly, found.shapes[:, :count].real)
    pure = _normalised(motions.astype(complex), assembly.matrices.mass)
    shapes = np.hstack([pure, found.shapes[:, count:]])
    return replace(found, shapes=shapes, names=(*names, *found.names[count:]))


def _named(assembly: Assembly, resting: Real) -> tuple[list[str], Real]:
    """Names and motions that span those at rest; (nv, n_rest)."""
    machine, mass = assembly.machine, assembly.matrices.mass
    names: list[str] = []
    motions: list[Real] = []
    left = resting
    candidates = [*_whole(assembly), *_single(assembly)]
    for name, motion in candidates:
        within = resting @ (resting.T @ mass @ motion)
        size = np.sqrt(motion @ mass @ motion)
        outside = motion - within
        new = left @ (left.T @ mass @ motion)
        if (
            np.sqrt(outside @ mass @ outside) <= _SAME * size
            and float(new @ mass @ new) > 1e-6 * size**2
        ):
            names.append(name)
            motions.append(motion)
            left = _without(left, new, mass)
    for motion in left.T:
        main = np.argsort(-np.abs(motion))[:3]
        strong = sorted(k for k in main if abs(motion[k]) > 0.1 * abs(motion[main[0]]))
        names.append("free " + " with ".join(machine.coordinates[k] for k in strong))
        motions.append(motion)
    return names, np.array(motions).T


def _whole(assembly: Assembly) -> list[tuple[str, Real]]:
    """Each group of bodies that springs hold together as one rigid body, where joints allow it."""
    machine, jacobian = assembly.machine, assembly.jacobian
    masses = np.diag(assembly.body[2])[::6]
    groups = _groups(assembly)
    found = []
    for members in groups:
        centre = masses[members] @ machine.layout.centres[members] / masses[members].sum()
        rigid = (machine.floor @ transport(-centre)).reshape(len(masses), 6, 6)
        rigid[~members] = 0.0
        suffix = f" of {machine.layout.bodies[int(np.argmax(members))]}" if len(groups) > 1 else ""
        for direction, motion in zip(DIRECTIONS, rigid.reshape(-1, 6).T, strict=True):
            joint = np.asarray(np.linalg.lstsq(jacobian, motion, rcond=None)[0], np.float64)
            if np.linalg.norm(jacobian @ joint - motion) <= _SAME * np.linalg.norm(motion):
                found.append((f"rigid {direction}{suffix}", joint))
    return found


def _groups(assembly: Assembly) -> list[Mask]:
    """Which bodies belong together: they share a joint coordinate, or a spring; (n_body,) each."""
    size = len(assembly.jacobian) // 6
    moved = assembly.jacobian.reshape(size, 6, -1).any(axis=1)
    reach = moved.astype(float)
    springs = (assembly.matrices.stiffness != 0).astype(float)
    tied = reach @ (springs + np.eye(len(springs))) @ reach.T
    count, labels = connected_components(tied > 0, directed=False)
    return [labels == k for k in range(count)]


def _single(assembly: Assembly) -> list[tuple[str, Real]]:
    names = assembly.machine.coordinates
    return [(f"free {name}", row) for name, row in zip(names, np.eye(len(names)), strict=True)]


def _without(basis: Real, motion: Real, mass: Real) -> Real:
    """The M-orthonormal basis less one direction of its span."""
    weights = basis.T @ mass @ motion
    rest = scipy.linalg.null_space(weights[None] / np.linalg.norm(weights))
    smaller: Real = basis @ rest
    return smaller


def shapes_at(model: Model, theta: Real, found: Modes, outputs: Sequence[Dof]) -> Complex:
    """Motion at sensors or centres of mass in each mode: L T phi; (n_out, n_mode).

    Raises:
        UsageError: a label that the machine does not have.
    """
    assembly = model.assemble(theta)
    here = places(model.machine, outputs, ())
    here = changed(here, assembly.point_changes, outputs, ())
    shapes: Complex = here.readout @ assembly.jacobian @ found.shapes
    return shapes
