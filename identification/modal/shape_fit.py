"""Linear fit of shapes and residuals to FRFs at given poles and participation.

    H_oi(s) = s^q [ sum_r (phi_or l_ri / (s - s_r) + its conjugate) + v_oi / s^2 + u_oi ]

with s = i w and q = 0, 1, 2 for receptance, mobility, accelerance. The real residuals v and u stand
for modes below and above the band (Ewins 2000, ch. 4). Given poles s_r and participation l_r all
else is linear, output by output (least-squares frequency domain, LSFD). The normal equations of an
output are sums over lines of products of 4 m + 2 kernels. The kernels are s^q / (s - s_r), its
square, their conjugates, s^q and s^(q - 2).
"""

from dataclasses import dataclass, replace

import numpy as np

from identification.words import Complex, HasPoles, Real, modal_sum

# Added to each diagonal entry of a normal matrix, relative to it, for collinear columns.
_NORMAL_RIDGE = 1e-12
_N_BLOCK_VALUES = 1_000_000  # values whose error is held at once, 16 MB


@dataclass(frozen=True, eq=False)
class WeightedFrfs:
    """FRFs and their weights in a fit.

    Args:
        laplace: s of every line [rad/s]; (n_freq,).
        order: q: 0, 1, 2 for receptance, mobility, accelerance.
        values: H, zero where not measured; (n_freq, n_out, n_in).
        weights: one over the variance, zero where not measured; (n_freq, n_out, n_in), or (n_freq,
            1, 1) times ``cells`` if they are separable.
        cells: weights of the cells beside those of the lines; (n_out, n_in).
        correlated_lines: number of lines that hold the information of one independent line; the
            weights include it.
    """

    laplace: Complex
    order: int
    values: Complex
    weights: Real
    cells: Real
    correlated_lines: float = 1.0

    @property
    def separable(self) -> bool:
        """Whether the weights of lines are equal in all cells."""
        return self.weights.shape[1:] == (1, 1)


@dataclass(frozen=True, eq=False)
class ModalFit(HasPoles):
    """A modal model that was fitted to measured FRFs.

    Args:
        poles: s_r, Im > 0 [rad/s]; (n_mode,).
        participation: l_r; (n_in, n_mode).
        shapes: phi_r of receptance; (n_out, n_mode).
        lower, upper: residuals v and u; (n_out, n_in).
        cost: sum of |error|^2 times weights.
    """

    poles: Complex
    participation: Complex
    shapes: Complex
    lower: Real
    upper: Real
    cost: float

    def values(self, laplace: Complex, order: int) -> Complex:
        """Compute H of a quantity of order q; (n_freq, n_out, n_in)."""
        return modal_sum(self, laplace, order)


def build_kernels(data: WeightedFrfs, poles: Complex) -> Complex:
    """Compute s^q / (s - s_r), its conjugate, their squares, s^q and s^(q-2); (n_freq, 4 m + 2)."""
    s = data.laplace[:, None]
    scale = s**data.order
    away, twin = 1.0 / (s - poles), 1.0 / (s - poles.conj())
    return np.hstack(
        [scale * k for k in (away, twin, away**2, twin**2)] + [scale, s ** (data.order - 2)]
    )


class KernelSums:
    """Sums over lines of products of kernels with each other and with the data."""

    def __init__(self, data: WeightedFrfs, poles: Complex) -> None:
        self.data, self.poles = data, poles
        self.kernels = build_kernels(data, poles)
        n_out, n_in = data.cells.shape
        weights = np.broadcast_to(data.weights, (len(data.laplace), *data.weights.shape[1:]))
        scaled = self.kernels.conj()
        if data.separable:
            scaled *= weights[:, 0]
            self.weighted = scaled.T
            gram = self.weighted @ self.kernels
            self.grams = np.broadcast_to(gram, (n_out, n_in, *gram.shape))
        else:
            size = self.kernels.shape[1]
            self.grams = np.empty((n_out, n_in, size, size), complex)
            for out in range(n_out):
                for inp in range(n_in):
                    self.grams[out, inp] = (scaled * weights[:, out, inp, None]).T @ self.kernels

    def project(self, values: Complex) -> Complex:
        """Return K^H W h of every cell; (n_out, n_in, 4 m + 2)."""
        if self.data.separable:  # the lines' weights are in the kernels
            summed = self.weighted @ values.reshape(len(values), -1)
        else:
            summed = self.kernels.conj().T @ (values * self.data.weights).reshape(len(values), -1)
        return summed.T.reshape(*values.shape[1:], -1)


def _linear_frame(participation: Complex) -> Complex:
    """Return the map from Re phi, Im phi, v, u to kernels; (n_in, 4 m + 2, 2 m + 2 n_in)."""
    n_in, m = participation.shape
    frame = np.zeros((n_in, 4 * m + 2, 2 * m + 2 * n_in), complex)
    mode = np.arange(m)
    for inp, row in enumerate(participation):
        frame[inp, mode, mode] = row
        frame[inp, m + mode, mode] = row.conj()
        frame[inp, mode, m + mode] = 1j * row
        frame[inp, m + mode, m + mode] = -1j * row.conj()
        frame[inp, 4 * m, 2 * m + n_in + inp] = 1.0
        frame[inp, 4 * m + 1, 2 * m + inp] = 1.0
    return frame


def fit_shapes(data: WeightedFrfs, poles: Complex, participation: Complex) -> ModalFit:
    """Fit shapes and residuals by linear least squares (LSFD).

    Args:
        poles: (n_mode,).
        participation: (n_in, n_mode).

    Returns:
        The fit with these poles and participation.
    """
    fitted = _solve_linear(data, participation, *_linear_system(data, poles, participation))
    step = max(1, _N_BLOCK_VALUES // max(data.cells.size, 1))
    blocks = [slice(first, first + step) for first in range(0, len(data.laplace), step)]
    return replace(fitted, cost=sum(_cost(data, lines, fitted)[0] for lines in blocks))


def fit_shapes_with_sums(
    data: WeightedFrfs, poles: Complex, participation: Complex
) -> tuple[ModalFit, "LinearFit"]:
    """Fit shapes and residuals, and return the intermediate results of the linear fit too."""
    sums, frame, normal = _linear_system(data, poles, participation)
    fitted = _solve_linear(data, participation, sums, frame, normal)
    cost, error = _cost(data, slice(None), fitted)
    return replace(fitted, cost=cost), LinearFit(sums, frame, normal, error)


def _linear_system(
    data: WeightedFrfs, poles: Complex, participation: Complex
) -> tuple[KernelSums, Complex, Real]:
    """Return sums over lines, the map from parameters to kernels, and the normal matrices."""
    sums = KernelSums(data, poles)
    frame = _linear_frame(participation)
    return sums, frame, _normal_matrices_of_outputs(data, sums, frame)


def _solve_linear(
    data: WeightedFrfs, participation: Complex, sums: KernelSums, frame: Complex, normal: Real
) -> ModalFit:
    """Return the fit that solves the normal equations; its cost is not computed yet."""
    poles = sums.poles
    right = np.einsum(
        "oi,ikb,oik->ob", data.cells, frame.conj(), sums.project(data.values), optimize=True
    ).real
    solution = np.linalg.solve(normal, right[:, :, None])[:, :, 0]
    m, n_in = len(poles), len(participation)
    shapes = solution[:, :m] + 1j * solution[:, m : 2 * m]
    lower, upper = solution[:, 2 * m : 2 * m + n_in], solution[:, 2 * m + n_in :]
    return ModalFit(poles, participation, shapes, lower, upper, 0.0)


def _cost(data: WeightedFrfs, lines: slice, fitted: ModalFit) -> tuple[float, Complex]:
    """Return the cost of some lines, and the error there; (n_line, n_out, n_in)."""
    error = data.values[lines] - fitted.values(data.laplace[lines], data.order)
    return float((np.abs(error) ** 2 * data.weights[lines] * data.cells).sum()), error


@dataclass(frozen=True, eq=False)
class LinearFit:
    """Intermediate results of the linear fit that the nonlinear fit uses."""

    sums: KernelSums
    frame: Complex
    normal: Real
    error: Complex


def _normal_matrices_of_outputs(data: WeightedFrfs, sums: KernelSums, frame: Complex) -> Real:
    """Compute the normal matrix of the shapes of every output; (n_out, n_b, n_b)."""
    if data.separable:
        inner = np.stack([(row.conj().T @ sums.grams[0, 0] @ row).real for row in frame])
        normal: Real = np.einsum("oi,iab->oab", data.cells, inner)
    else:
        normal = np.zeros((len(data.cells), frame.shape[2], frame.shape[2]))
        for inp, row in enumerate(frame):
            grams = sums.grams[:, inp] * data.cells[:, inp, None, None]
            normal += (row.conj().T @ grams @ row).real
    diagonal = np.arange(normal.shape[1])
    normal[:, diagonal, diagonal] *= 1 + _NORMAL_RIDGE
    empty = normal[:, diagonal, diagonal] == 0
    normal[:, diagonal, diagonal] += empty
    return normal


def reduced_chi_square(data: WeightedFrfs, fitted: ModalFit) -> float:
    """Return the cost per value, at least 1.

    Drops of the cost below it can result from noise or from errors of the model.
    """
    n_values = int((data.cells > 0).sum()) * len(data.laplace)
    return max(1.0, fitted.cost * data.correlated_lines / n_values)


def weighted_error(data: WeightedFrfs, fitted: ModalFit) -> Complex:
    """Return the residual of a fit over its standard deviation; (n_freq, n_out, n_in)."""
    error: Complex = data.values - fitted.values(data.laplace, data.order)
    return np.asarray(error * np.sqrt(data.weights * data.cells))


def cost_rise_without(data: WeightedFrfs, fitted: ModalFit) -> Real:
    """Compute how much the cost would rise without each mode, the others refitted; (n_mode,).

    Leaving columns S out of a least-squares fit with normal matrix G and solution x raises the cost
    by x_S' [(G^-1)_SS]^-1 x_S.
    """
    refitted, linear = fit_shapes_with_sums(data, fitted.poles, fitted.participation)
    inverse = np.linalg.inv(linear.normal)
    m = len(fitted.poles)
    pairs = np.stack([np.arange(m), m + np.arange(m)], axis=1)
    blocks = inverse[:, pairs[:, :, None], pairs[:, None, :]]
    parts = np.stack([refitted.shapes.real, refitted.shapes.imag], axis=-1)
    solved = np.linalg.solve(blocks, parts[..., None])[..., 0]
    return (parts * solved).sum(axis=(0, 2))


def shape_deviations(data: WeightedFrfs, fitted: ModalFit) -> Real:
    """Compute the standard deviations of the shapes at given poles and participation.

    With weights of one over the variance, half the inverse of the normal matrix of an output is the
    covariance of real and imaginary parts.

    Returns:
        sqrt(E|error|^2) of each entry; (n_out, n_mode).
    """
    _, _, normal = _linear_system(data, fitted.poles, fitted.participation)
    m = len(fitted.poles)
    variances = np.diagonal(np.linalg.inv(normal), axis1=1, axis2=2)[:, : 2 * m] / 2
    return np.sqrt(np.maximum(variances[:, :m] + variances[:, m:], 0.0))
