r"""Poly-reference least-squares complex frequency-domain method, all model orders at once.

With y = exp(-i w dt), dt half the period of the highest line, every row of FRFs is modelled as
H_o(w) = B_o(y) A(y)^-1, B_o = sum_k b_ok y^k (1 x n_in), A = sum_k A_k y^k (n_in x n_in), real
coefficients, k = 0 .. n. The error B_o - H_o A is linear in them; without the b it leaves

    M = sum_o [T_o - S_o' R^-1 S_o],  R = Re X^H X, S_o = Re X^H Y_o, T_o = Re Y_o^H Y_o

with X the powers y^k and Y_o those times H_o (Guillaume et al. 2003; Verboven 2002, ch. 5.3). All
three are Toeplitz: sums over lines for each difference of powers. R = L L' and L^-1 S of a lower
order are the leading parts of those of a higher one, so that M of all orders costs little more
than M of the highest. The coefficient of the highest power is set to one: noise then makes
unstable poles, which are told apart by their sign (Cauberghe et al. 2005).

Where det A(y) = 0 lies a pole s = -ln(y) / dt. There A^-1 becomes v l' / (y - y_r): the row l with
l' A = 0 is the participation of the inputs, from the companion matrix of A'; the shapes B v are
fitted afterwards (``fit``).
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from identification.words import Complex, HasPoles, Real, UsageError

_RIDGE = 1e-13  # of the largest entry, so that R has a root where few lines are left


@dataclass(frozen=True, eq=False)
class Poles(HasPoles):
    """Stable and unstable poles of one model order, of each pair the one with Im > 0.

    Args:
        order: n, highest power of the polynomials.
        poles: s [rad/s]; (n_pole,).
        participation: l of each pole, of norm 1; (n_in, n_pole).
    """

    order: int
    poles: Complex
    participation: Complex


def lscf(freq_hz: Real, values: Complex, highest: int) -> tuple[Poles, ...]:
    """Poles of every order from 1 to the highest.

    Args:
        freq_hz: evenly spaced lines, above 0 Hz [Hz]; (n_freq,).
        values: FRFs; (n_freq, n_out, n_in). Rows may be weighted, single cells may not: the
            inputs of one row belong together.
        highest: highest order; n_in times as many roots.

    Returns:
        One set of poles an order.

    Raises:
        UsageError: too few lines for that order.
    """
    n_freq, _, n_in = values.shape
    if n_freq < 2 * (highest + 1):
        raise UsageError(
            f"{n_freq} lines are too few for order {highest}: ask for at most {n_freq // 2 - 1}"
        )
    step = 1.0 / (2.0 * freq_hz[-1])
    normal = _normal_matrices(freq_hz * step, values, highest)
    found = []
    for order, matrix in enumerate(normal, start=1):
        size = order * n_in
        coefficients = np.asarray(-np.linalg.solve(matrix[:size, :size], matrix[:size, size:]))
        found.append(_roots(order, coefficients, n_in, step))
    return tuple(found)


def _normal_matrices(turns: Real, values: Complex, highest: int) -> list[Real]:
    """M of the orders 1 .. highest; ((n + 1) n_in,) * 2 each.

    Args:
        turns: f dt of every line; (n_freq,).
        values: H; (n_freq, n_out, n_in).
        highest: n.
    """
    n_freq, n_out, n_in = values.shape
    size = highest + 1
    kernel = np.exp(-2j * np.pi * np.outer(np.arange(-highest, size), turns))
    between = np.arange(size)[None, :] - np.arange(size)[:, None] + highest
    r = kernel.sum(axis=1).real[between]
    s = (kernel @ values.reshape(n_freq, -1)).real.reshape(-1, n_out, n_in)
    squares = values.conj().transpose(0, 2, 1) @ values
    t = (kernel @ squares.reshape(n_freq, -1)).real.reshape(-1, n_in, n_in)
    root = np.linalg.cholesky(r + _RIDGE * r[0, 0] * np.eye(size))
    mixed = s[between].transpose(0, 2, 1, 3).reshape(size, -1)
    white = scipy.linalg.solve_triangular(root, mixed, lower=True, check_finite=False)
    white = white.reshape(size, n_out, size * n_in)
    total = t[between].transpose(0, 2, 1, 3).reshape(size * n_in, size * n_in)
    explained = np.zeros_like(total)
    matrices = []
    for order in range(size):
        own = white[order]
        explained += own.T @ own
        count = (order + 1) * n_in
        if order:
            matrices.append(total[:count, :count] - explained[:count, :count])
    return matrices


def _roots(order: int, coefficients: Real, n_in: int, step: float) -> Poles:
    """Poles and participation from A_0 .. A_(n-1), A_n = 1, by the companion matrix."""
    size = order * n_in
    companion = np.eye(size, k=n_in)
    transposed = coefficients.reshape(order, n_in, n_in).transpose(2, 0, 1)
    companion[size - n_in :] = -transposed.reshape(n_in, size)
    roots, vectors = np.linalg.eig(companion)
    with np.errstate(divide="ignore"):
        poles = -np.log(roots.astype(complex)) / step
    keep = np.isfinite(poles) & (poles.imag > 0) & (poles.imag < (1 - 1e-6) * np.pi / step)
    participation = vectors[:n_in, keep].astype(complex)
    return Poles(order, poles[keep], participation / np.linalg.norm(participation, axis=0))
