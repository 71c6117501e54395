"""The scaled complex modal form of M q'' + C q' + K q = f: one eigenproblem serves all lines.

With the real modes of (M, K), M-orthonormal, ``Phi' K Phi = diag(k)``, w = sqrt|k|, and the state
(w z, z'), the equation reads

    d/dt [w z; z'] = A [w z; z'] + [0; Phi' f],   A = [[0, w], [-sign(k) w, -Phi' C Phi]]

A is skew-symmetric but for the damping, so its eigenvectors V are well conditioned. With
V^-1 = W, the upper and lower half V1, V2 of V and the right half W2 of W,

    Z(s)^-1 = Phi w^-1 V1 (s - Lambda)^-1 W2 Phi' = (1/s) Phi V2 (s - Lambda)^-1 W2 Phi'.

The first form is exact down to 0 Hz; the second serves machines with rigid-body modes (w = 0),
which are no double poles in velocities.

A pole a + ib and its conjugate are summed in real arithmetic. With d = (s - a)^2 + b^2,
P = 2 (s - a) / d, N = -2 b / d, and v w the column and row of the pole,
v w / (s - lambda) + conj. = Re(v w) P + Im(v w) N (Ewins 2000, ch. 2.8, for the modal series).
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from identification.words import Complex, Real
from mbmodel.assembly import Matrices

_MAX_STIFFNESS_ASYMMETRY = 1e-9  # of the diagonal entries: larger is no rounding
# Lowest over highest natural frequency; below it a machine counts as free.
_MIN_FREQUENCY_RATIO = 1e-5


@dataclass(frozen=True, eq=False)
class ModalForm:
    """Poles with Im >= 0, and the real and imaginary parts of their shapes.

    Args:
        poles: lambda [rad/s]; (h,).
        columns: Phi w^-1 V1 or Phi V2, real then imaginary parts, real poles halved; (nv, 2 h).
        rows: W2 Phi', real then imaginary parts; (2 h, nv).
        in_velocity: whether the columns are velocities, Phi V2.
        condition: largest condition number of an eigenvalue, ``|w| |v|`` with w v = 1.
    """

    poles: Complex
    columns: Real
    rows: Real
    in_velocity: bool
    condition: float

    @property
    def transposed(self) -> "ModalForm":
        """The form of the transpose Z', whose columns are the rows of Z."""
        return replace(self, columns=self.rows.T, rows=self.columns.T)

    def kernels(self, laplace: Complex) -> Complex:
        """Return P and then N at each s; (2 h, n_freq).

        For a form in velocities they are divided by s, and zero at s = 0.

        Args:
            laplace: s [rad/s]; (n_freq,).
        """
        shifted = laplace - self.poles.real[:, None]
        divisor = shifted**2 + self.poles.imag[:, None] ** 2
        moving = laplace != 0
        if self.in_velocity:
            divisor *= laplace
            inverse = 2.0 * moving / np.where(moving, divisor, 1.0)
        else:
            inverse = 2.0 / divisor
        half = len(self.poles)
        kernels = np.empty((2 * half, len(laplace)), np.complex128)
        np.multiply(shifted, inverse, out=kernels[:half])
        np.multiply(-self.poles.imag[:, None], inverse, out=kernels[half:])
        return kernels

    def receptance(
        self,
        force: Real | Complex,
        kernels: Complex,
        through: Real | None = None,
    ) -> Complex:
        """Return Z(s)^-1 f at every line; zero at s = 0 if the form is in velocities.

        Args:
            force: generalised forces; (nv, m, 1) real if constant over lines, or (nv, m, n_freq)
                complex.
            kernels: from ``kernels``, times a factor of each line.
            through: if given, the generalised forces are this matrix times ``force``; (nv, n).

        Returns:
            Generalised displacements; (nv, m, n_freq).
        """
        half = len(self.poles)
        rows = self.rows if through is None else self.rows @ through
        drive = real_times(rows, force)
        n_freq = kernels.shape[-1]
        if not np.iscomplexobj(drive) and len(self.columns) <= 2 * n_freq:
            return self._constant_force_receptance(drive[..., 0].real, kernels)
        even, odd = kernels[:half, None, :], kernels[half:, None, :]
        real, imag = drive[:half], drive[half:]
        # Of a constant force, this needs 2 h numbers per line, and residues 2 h nv in all.
        state = np.empty((*drive.shape[:2], n_freq), complex)
        scratch = np.empty((half, *state.shape[1:]), complex)
        for target, first, second, combine in (
            (state[:half], real, imag, np.add),
            (state[half:], imag, real, np.subtract),
        ):
            # real P + imag N, and real N - imag P with its sign moved to the columns
            np.multiply(first, even, out=target)
            np.multiply(second, odd, out=scratch)
            combine(target, scratch, out=target)
        columns = np.hstack([self.columns[:, :half], -self.columns[:, half:]])
        return real_times(columns, state)

    def _constant_force_receptance(self, drive: Real, kernels: Complex) -> Complex:
        """Return Z(s)^-1 f of a force that is constant over lines: residues times the kernels.

        Args:
            drive: rows times the force; (2 h, m).
            kernels: P and then N; (2 h, n_freq).
        """
        half = len(self.poles)
        real_column, imag_column = self.columns[:, None, :half], self.columns[:, None, half:]
        real, imag = drive[:half].T, drive[half:].T
        residues = np.concatenate(
            [real_column * real - imag_column * imag, real_column * imag + imag_column * real],
            axis=2,
        )
        size, m = residues.shape[:2]
        motion = real_times(residues.reshape(size * m, 2 * half), kernels)
        return motion.reshape(size, m, kernels.shape[-1])


def real_times(matrix: Real, array: Real | Complex) -> Complex:
    """Multiply a real matrix (n, m) with a real or complex array (m, ...) as one real product.

    Returns:
        (n, ...), complex if the array is.
    """
    flat = np.ascontiguousarray(array).reshape(len(array), -1)
    product: NDArray[Any] = matrix @ flat.view(np.float64)
    if np.iscomplexobj(flat):
        product = product.view(np.complex128)
    return product.reshape(len(matrix), *array.shape[1:])


def modal_form(matrices: Matrices) -> ModalForm | None:
    """Solve the eigenproblem of a machine once, for all lines.

    Args:
        matrices: M symmetric positive definite, K symmetric; C may be any matrix.

    Returns:
        The form, or None if it does not exist: K is not symmetric, M not positive definite, or
        eigenvectors are numerically dependent (a defective pole).
    """
    mass, damping, stiffness = matrices.mass, matrices.damping, matrices.stiffness
    scale = np.sqrt(np.outer(np.diag(np.abs(stiffness)), np.diag(np.abs(stiffness))))
    if (
        np.abs(stiffness - stiffness.T)
        > _MAX_STIFFNESS_ASYMMETRY * (scale + np.abs(stiffness).max() * 1e-9)
    ).any():
        return None
    try:
        squares, shapes = scipy.linalg.eigh(stiffness, mass, check_finite=False)
        frequency = np.sqrt(np.abs(squares))
        size = len(mass)
        state = np.zeros((2 * size, 2 * size))
        diagonal = np.arange(size)
        state[diagonal, size + diagonal] = frequency
        state[size + diagonal, diagonal] = -np.sign(squares) * frequency
        state[size:, size:] = -shapes.T @ damping @ shapes
        poles, right = np.linalg.eig(state)
        keep = poles.imag >= 0
        right, poles = right[:, keep], poles[keep].astype(complex, copy=False)
        left = _left_vectors(poles, right)
    except np.linalg.LinAlgError:
        return None
    weight = np.where(poles.imag == 0, 0.5, 1.0)
    in_velocity = bool(frequency.min() <= _MIN_FREQUENCY_RATIO * frequency.max())
    upper = (right[size:] if in_velocity else right[:size] / frequency[:, None]) * weight
    lower = left[:, size:]
    return ModalForm(
        poles,
        np.hstack([shapes @ upper.real, shapes @ upper.imag]),
        np.vstack([lower.real @ shapes.T, lower.imag @ shapes.T]),
        in_velocity,
        float((np.linalg.norm(left, axis=1) * np.linalg.norm(right, axis=0)).max()),
    )


def _left_vectors(poles: Complex, right: Complex) -> Complex:
    """Return the rows W of the kept poles with W V = 1, V the vectors of all poles.

    A pole and its conjugate share a real inverse. The columns Re v, Im v are V times
    [[1, 1], [-i, i]] / 2, so that w = (p - i q) / 2 with p, q the rows of their inverse. This takes
    a fourth of the work of a complex inverse.

    Args:
        poles: those with Im >= 0; (h,).
        right: their right vectors v; (2 nv, h).
    """
    pairs = poles.imag > 0
    count = int(pairs.sum())
    basis = np.hstack([right[:, pairs].real, right[:, pairs].imag, right[:, ~pairs].real])
    inverse = np.linalg.inv(basis)
    left = np.empty((len(poles), len(right)), complex)
    left[pairs] = 0.5 * (inverse[:count] - 1j * inverse[count : 2 * count])
    left[~pairs] = inverse[2 * count :]
    return left
