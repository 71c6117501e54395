"""Poly-reference least-squares complex frequency-domain method (LSCF), all model orders at once.

With y = exp(-i w dt), dt half the period of the highest line, every row of FRFs is modelled as
H_o(w) = B_o(y) A(y)^-1. The method is that of Guillaume, Verboven, Vanlanduit, Van der Auweraer and
Peeters (2003). Here B_o = sum_k b_ok y^k (1 x n_in) and A = sum_k A_k y^k (n_in x n_in) have real
coefficients, k = 0 .. n. The error B_o - H_o A is linear in them. Eliminating the b leaves the
Schur complement

    M = sum_o [T_o - S_o' R^-1 S_o],  R = Re X^H X, S_o = Re X^H Y_o, T_o = Re Y_o^H Y_o

with X the powers y^k and Y_o those times H_o (Verboven 2002, ch. 5.3). All three are Toeplitz: sums
over lines for each difference of powers. R = L L' and L^-1 S of a lower order are the leading parts
of those of a higher one. So M of all orders costs little more than M of the highest. The
coefficient of the highest power is set to one. Noise then gives unstable poles, which differ from
physical ones by the sign of their real part (Cauberghe et al. 2005).

A root of det A(y) = 0 gives a pole s = -ln(y) / dt. There A^-1 becomes v l' / (y - y_r). The row l
with l' A = 0 is the participation of the inputs, from the companion matrix of A'. The shapes B v
are fitted afterwards (``refinement.fit_shapes``).
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from identification.words import Complex, HasPoles, Real, UsageError

# Added to the diagonal of R, relative to its largest entry: with few lines R is near singular.
_CHOLESKY_RIDGE = 1e-13


@dataclass(frozen=True, eq=False)
class Poles(HasPoles):
    """Stable and unstable poles of one model order; of each conjugate pair the pole with Im > 0.

    Args:
        order: n, highest power of the polynomials.
        poles: s [rad/s]; (n_pole,).
        participation: l of each pole, of norm 1; (n_in, n_pole).
    """

    order: int
    poles: Complex
    participation: Complex


def lscf(freq_hz: Real, values: Complex, max_order: int) -> tuple[Poles, ...]:
    """Compute the poles of every model order from 1 to the highest.

    Args:
        freq_hz: evenly spaced lines, above 0 Hz [Hz]; (n_freq,).
        values: FRFs; (n_freq, n_out, n_in). Rows may be weighted. Single cells may not, since the
            inputs of one row belong together.
        max_order: highest order; it has n_in times as many roots.

    Returns:
        One set of poles an order.

    Raises:
        UsageError: too few lines for that order.
    """
    n_freq, _, n_in = values.shape
    if n_freq < 2 * (max_order + 1):
        raise UsageError(
            f"{n_freq} frequency lines are too few for order {max_order}: use at most order "
            f"{n_freq // 2 - 1}"
        )
    step = 1.0 / (2.0 * freq_hz[-1])
    normal = _normal_matrices(freq_hz * step, values, max_order)
    pole_sets = []
    for order, matrix in enumerate(normal, start=1):
        size = order * n_in
        coefficients = -_solve(matrix[:size, :size], matrix[:size, size:])
        pole_sets.append(_companion_roots(order, coefficients, n_in, step))
    return tuple(pole_sets)


def _solve(matrix: Real, right: Real) -> Real:
    """Solve M x = b; for a singular M, of FRFs that are all alike, return the shortest solution."""
    try:
        return np.asarray(np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.lstsq(matrix, right)[0])


def _normal_matrices(turns: Real, values: Complex, max_order: int) -> list[Real]:
    """Compute M of the orders 1 .. n; ((order + 1) n_in,) * 2 each.

    Args:
        turns: f dt of every line; (n_freq,).
        max_order: n.
    """
    n_freq, n_out, n_in = values.shape
    size = max_order + 1
    kernel = np.exp(-2j * np.pi * np.outer(np.arange(-max_order, size), turns))
    between = np.arange(size)[None, :] - np.arange(size)[:, None] + max_order
    power_sums = kernel.sum(axis=1).real[between]
    cross_sums = (kernel @ values.reshape(n_freq, -1)).real.reshape(-1, n_out, n_in)
    squares = values.conj().transpose(0, 2, 1) @ values
    output_sums = (kernel @ squares.reshape(n_freq, -1)).real.reshape(-1, n_in, n_in)
    cholesky = np.linalg.cholesky(power_sums + _CHOLESKY_RIDGE * power_sums[0, 0] * np.eye(size))
    mixed = cross_sums[between].transpose(0, 2, 1, 3).reshape(size, -1)
    whitened = scipy.linalg.solve_triangular(cholesky, mixed, lower=True, check_finite=False)
    whitened = whitened.reshape(size, n_out, size * n_in)
    total = output_sums[between].transpose(0, 2, 1, 3).reshape(size * n_in, size * n_in)
    explained = np.zeros_like(total)
    matrices = []
    for order in range(size):
        whitened_block = whitened[order]
        explained += whitened_block.T @ whitened_block
        count = (order + 1) * n_in
        if order:
            matrices.append(total[:count, :count] - explained[:count, :count])
    return matrices


def _companion_roots(order: int, coefficients: Real, n_in: int, step: float) -> Poles:
    """Compute poles and participation from A_0 .. A_(n-1), A_n = 1, by the companion matrix."""
    size = order * n_in
    companion = np.eye(size, k=n_in)
    transposed = coefficients.reshape(order, n_in, n_in).transpose(2, 0, 1)
    companion[size - n_in :] = -transposed.reshape(n_in, size)
    roots, vectors = np.linalg.eig(companion)
    with np.errstate(divide="ignore", invalid="ignore"):
        poles = -np.log(roots.astype(complex)) / step
    keep = np.isfinite(poles) & (poles.imag > 0) & (poles.imag < (1 - 1e-6) * np.pi / step)
    participation = vectors[:n_in, keep].astype(complex)
    return Poles(order, poles[keep], participation / np.linalg.norm(participation, axis=0))
