"""Fit of a stable rational function to values along frequency: vector fitting."""

import numpy as np

from identification.words import Complex, Real
from mbmodel.export.rational_function import RationalFunction

_RELOCATIONS = 8  # of the poles; they rest after some five
_START_POLE_DAMPING = 0.01  # ratio of the poles at the start (Gustavsen and Semlyen 1999)


def fit_poles_and_residues(
    laplace: Complex, values: Complex, order: int, *, has_slope: bool, has_loss: bool = False
) -> tuple[RationalFunction, float]:
    """Fit a stable rational function in least squares, and a constant loss h beside it.

    Gustavsen and Semlyen (1999): with poles p_k, sigma(s) f(s) = N(s) is linear in the residues of
    sigma and N. The zeros of sigma are better poles; those of the right half plane are reflected.
    After some rounds the residues follow from the poles.

    Args:
        laplace: s = i w with w > 0 [rad/s]; (n_freq,).
        values: f(s); (n_freq,).
        order: number of poles.
        has_slope: whether a term proportional to s is fitted.
        has_loss: whether i h, at w > 0, is fitted.

    Returns:
        The function, and h; 0 without a loss.
    """
    poles = _start(laplace.imag, order)
    for _ in range(_RELOCATIONS):
        basis = _basis(poles, laplace)
        polynomial = _polynomial(laplace, has_slope=has_slope, has_loss=has_loss)
        matrix = np.hstack([basis, polynomial, -values[:, None] * basis])
        solution = _solve(matrix, values)
        poles = _zeros(poles, solution[-order:])
    polynomial = _polynomial(laplace, has_slope=has_slope, has_loss=has_loss)
    residues, rest = _residues(poles, laplace, values, polynomial)
    loss = rest.pop() if has_loss else 0.0
    return RationalFunction(poles, residues, *rest), loss


def _start(omega: Real, order: int) -> Complex:
    """Return pairs spread over the band, and a real pole if the order is odd."""
    centres = np.geomspace(omega[0], omega[-1], order // 2 + 2)[1:-1]
    pairs = centres * (-_START_POLE_DAMPING + 1j)
    real = [-np.sqrt(omega[0] * omega[-1]) + 0j] if order % 2 else []
    return np.concatenate([pairs, real])


def _basis(poles: Complex, laplace: Complex) -> Complex:
    """Return functions with real coefficients that span the fractions; (n_freq, order)."""
    columns = []
    for pole in poles:
        first = 1 / (laplace - pole)
        if pole.imag > 0:
            second = 1 / (laplace - pole.conjugate())
            columns += [first + second, 1j * (first - second)]
        else:
            columns.append(first)
    return np.stack(columns, axis=1) if columns else np.zeros((len(laplace), 0), complex)


def _polynomial(laplace: Complex, *, has_slope: bool, has_loss: bool) -> Complex:
    """Return the columns 1, s and i; (n_freq, 1 to 3)."""
    columns = [np.ones_like(laplace), *([laplace] if has_slope else [])]
    return np.stack([*columns, *([1j * columns[0]] if has_loss else [])], axis=1)


def _solve(matrix: Complex, values: Complex) -> Real:
    """Solve a complex least-squares problem for real coefficients."""
    stacked = np.vstack([matrix.real, matrix.imag])
    scale = np.linalg.norm(stacked, axis=0)
    scale[scale == 0] = 1.0
    target = np.concatenate([values.real, values.imag])
    return np.linalg.lstsq(stacked / scale, target, rcond=1e-14)[0] / scale


def _zeros(poles: Complex, coefficients: Real) -> Complex:
    """Return the zeros of 1 + sum of fractions, reflected into the left half plane."""
    frame = RationalFunction(poles, np.zeros(len(poles), complex))
    dynamics, drive, _ = frame.states()
    reading, place = np.zeros(len(drive)), 0
    for pole in poles:
        if pole.imag > 0:
            # a (1/(s-p) + 1/(s-p*)) + b (i/(s-p) - i/(s-p*)): the residue a + i b
            reading[place : place + 2] = coefficients[place : place + 2]
            place += 2
        else:
            reading[place] = coefficients[place]
            place += 1
    zeros = np.linalg.eigvals(dynamics - np.outer(drive, reading))
    zeros = np.where(zeros.real > 0, -zeros.real, zeros.real) + 1j * zeros.imag
    return zeros[zeros.imag >= 0].astype(complex)


def _residues(
    poles: Complex, laplace: Complex, values: Complex, polynomial: Complex
) -> tuple[Complex, list[float]]:
    """Return residues, and the coefficients of further columns, for given poles."""
    basis = _basis(poles, laplace)
    solution = _solve(np.hstack([basis, polynomial]), values)
    residues, place = [], 0
    for pole in poles:
        if pole.imag > 0:
            residues.append(complex(solution[place], solution[place + 1]))
            place += 2
        else:
            residues.append(complex(solution[place]))
            place += 1
    return np.array(residues), solution[basis.shape[1] :].tolist()
