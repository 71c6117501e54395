"""Natural frequencies and damping ratios of a linearised model."""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from identification.words import Complex, Real
from mbmodel.model import Matrices


@dataclass(frozen=True, eq=False)
class Modes:
    """Eigenvalues of the equation of motion, one of each conjugate pair, by rising frequency.

    Args:
        poles: s_r = w_r (-zeta_r + i sqrt(1 - zeta_r^2)) (seed, eq. 3.4) [rad/s]; (n_mode,).
    """

    poles: Complex

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


def modes(matrices: Matrices) -> Modes:
    """Solve the quadratic eigenproblem (s^2 M + s C + K) phi = 0.

    Two poles stand for each coordinate. Oscillating poles count once a pair; real poles
    (overdamped, or rigid-body motion at zero) are listed singly.
    """
    size = len(matrices.mass)
    factor = scipy.linalg.cholesky(matrices.mass, lower=True)

    def symmetrised(matrix: Real) -> Real:
        half = scipy.linalg.solve_triangular(factor, matrix, lower=True)
        whole: Real = scipy.linalg.solve_triangular(factor, half.T, lower=True).T
        return whole

    stiffness, damping = symmetrised(matrices.stiffness), symmetrised(matrices.damping)
    unit = float(np.sqrt(np.linalg.norm(stiffness, 2))) or 1.0
    state = np.block([[np.zeros((size, size)), unit * np.eye(size)], [-stiffness / unit, -damping]])
    poles = np.linalg.eigvals(state)
    poles = poles[poles.imag >= 0]
    return Modes(poles[np.argsort(np.abs(poles))])
