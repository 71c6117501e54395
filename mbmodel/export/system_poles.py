"""Poles of a state space, with those at rest at 0 exactly."""

import numpy as np
import scipy.linalg

from identification.words import Complex, Real, poles_in_s

_ROUNDINGS = 100.0  # of numbers as large as ||A||, in A and in its eigenvalues


def system_poles(dynamics: Real, period_s: float = 0.0) -> Complex:
    r"""Return the poles of x' = A x, or log(z) / T of x[k+1] = A x[k]; (n,).

    An eigenvalue with unit left and right vectors y and x moves by at most ||E|| / |y' x| when A
    moves by E (Golub and Van Loan 2013, section 7.2.2), and rounding leaves an E of some eps ||A||.
    A pole of rest (s = 0, z = 1) is often a double one, which has orthogonal y and x, so that it
    comes out as the root of the rounding. An eigenvalue that could be that of rest is therefore
    returned as 0. A is balanced first, so that units of states do not count.

    Args:
        dynamics: A [1/s], without a unit in discrete time; (n, n).
        period_s: T [s]; 0 in continuous time.
    """
    if not len(dynamics):
        return np.zeros(0, complex)
    balanced, _ = scipy.linalg.matrix_balance(dynamics)
    values, left, right = scipy.linalg.eig(balanced, left=True)
    slant = np.abs((left.conj() * right).sum(axis=0))
    rounding = _ROUNDINGS * np.finfo(float).eps * np.linalg.norm(balanced)
    rest = 1.0 if period_s else 0.0
    poles = poles_in_s(values, period_s) if period_s else values
    return np.where(np.abs(values - rest) * slant <= rounding, 0.0, poles)
