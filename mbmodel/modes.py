"""Complex modes of a linearised model: poles, shapes, and rigid motions by name."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from identification.words import DIRECTIONS, Complex, Dof, Real
from mbmodel.model import Assembly, Matrices, Model
from mbmodel.places import changed, places

_AT_REST = 1e-6  # natural frequency over the highest below which only rounding is left
_UNDAMPED = 1e-9  # modal damping over the largest likewise
_SYMMETRY = 1e-9
_SAME = 1e-6  # relative distance of a motion from the motions at rest


@dataclass(frozen=True, eq=False)
class Modes:
    """Eigenvalues of the equation of motion, one of each conjugate pair, by rising frequency.

    Motions that neither springs nor dampers resist come first, at s = 0.

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
    def freq_hz(self) -> Real:
        """Natural frequencies |s_r| / 2 pi [Hz]; (n_mode,)."""
        frequency: Real = np.abs(self.poles) / (2 * np.pi)
        return frequency

    @property
    def damping(self) -> Real:
        """Damping ratios zeta_r = -Re s_r / |s_r|, 0 for a pole at rest; (n_mode,)."""
        size = np.abs(self.poles)
        ratio: Real = np.where(size > 0, -self.poles.real / np.where(size > 0, size, 1.0), 0.0)
        return ratio

    @property
    def oscillates(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Which are pairs: not overdamped and not at rest; (n_mode,)."""
        return self.poles.imag > 0


def modes(matrices: Matrices) -> Modes:
    """Solve the quadratic eigenproblem (s^2 M + s C + K) phi = 0.

    Two poles stand for each coordinate. Oscillating poles count once a pair; real poles
    (overdamped, or unstable) are listed singly, and a motion at rest once. In modal coordinates of
    (M, K) the state matrix is nearly skew (see ``modal``); motions that neither K nor C resist are
    taken out first, since their double zero would split by the root of the rounding.
    """
    stiffness = matrices.stiffness
    if np.abs(stiffness - stiffness.T).max() > _SYMMETRY * np.abs(stiffness).max():
        return _unsymmetric(matrices)
    squares, basis = scipy.linalg.eigh(matrices.stiffness, matrices.mass)
    frequency = np.sqrt(np.abs(squares))
    damping = basis.T @ matrices.damping @ basis
    resting = _at_rest(frequency, damping)
    moving = scipy.linalg.null_space(resting.T) if resting.size else np.eye(len(frequency))
    poles, shapes = _solve(
        moving.T @ (squares[:, None] * moving), moving.T @ damping @ moving, basis @ moving
    )
    order = np.argsort(np.abs(poles))
    count = resting.shape[1]
    shapes = np.hstack([basis @ resting, shapes[:, order]])
    return Modes(
        np.concatenate([np.zeros(count), poles[order]]),
        _normalised(shapes, matrices.mass),
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


def _at_rest(frequency: Real, damping: Real) -> Real:
    """Motions in modal coordinates that neither stiffness nor damping resists; (nv, n_rest)."""
    free = np.flatnonzero(frequency <= _AT_REST * frequency.max())
    unit = np.eye(len(frequency))[:, free]
    if not free.size:
        return unit
    felt = np.vstack([damping @ unit, damping.T @ unit])
    _, values, rows = np.linalg.svd(felt)
    values = np.append(values, np.zeros(len(free) - len(values)))
    undamped = values <= _UNDAMPED * max(float(np.abs(damping).max()), 1e-300)
    resting: Real = unit @ rows.T[:, undamped]
    return resting


def _solve(stiffness: Real, damping: Real, basis: Real) -> tuple[Complex, Complex]:
    """Poles with Im >= 0 and their shapes, for a unit mass matrix."""
    squares, turn = np.linalg.eigh((stiffness + stiffness.T) / 2)
    frequency, size = np.sqrt(np.abs(squares)), len(squares)
    state = np.zeros((2 * size, 2 * size))
    state[:size, size:] = np.diag(frequency)
    state[size:, :size] = -np.diag(np.sign(squares) * frequency)
    state[size:, size:] = -turn.T @ damping @ turn
    poles, vectors = np.linalg.eig(state)
    keep = poles.imag >= 0
    poles, vectors = poles[keep].astype(complex), vectors[:, keep]
    # z' = s z; a damped free drive at rest, s = 0, has its motion in the upper half alone
    rests = np.abs(poles) <= _AT_REST * frequency.max(initial=0.0)
    motion = np.where(rests, vectors[:size], vectors[size:] / np.where(rests, 1.0, poles))
    shapes: Complex = basis @ turn @ motion
    return poles, shapes


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
    of mass; ``free <joint>``: one coordinate; the rest by their largest coordinates.
    """
    assembly = model.assemble(theta)
    found = modes(assembly.matrices)
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
        strong = [k for k in main if abs(motion[k]) > 0.1 * abs(motion[main[0]])]
        names.append("free " + " with ".join(machine.coordinates[k] for k in strong))
        motions.append(motion)
    return names, np.array(motions).T


def _whole(assembly: Assembly) -> list[tuple[str, Real]]:
    """The machine as one rigid body, where its joints allow it."""
    machine, jacobian = assembly.machine, assembly.jacobian
    masses = np.diag(assembly.body[2])[::6]
    centre = masses @ machine.layout.centres / masses.sum()
    rigid = machine.floor.copy()
    rigid[:, 3:] -= rigid[:, :3] @ np.array(
        [[0, centre[2], -centre[1]], [-centre[2], 0, centre[0]], [centre[1], -centre[0], 0]]
    )
    found = []
    for direction, motion in zip(DIRECTIONS, rigid.T, strict=True):
        joint = np.linalg.lstsq(jacobian, motion, rcond=None)[0]
        if np.linalg.norm(jacobian @ joint - motion) <= _SAME * np.linalg.norm(motion):
            found.append((f"rigid {direction}", joint))
    return found


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
