r"""Fit of poles and participation to FRFs whose mode shapes are known.

    H_oi(s) = s^q [ sum_r (phi_or l_ri / (s - s_r) + its conjugate) + v_oi / s^2 + u_oi ]

is the model of ``identification.modal.shape_fit`` with the shapes phi held. All levels of a test
then share their shapes, so that a mode keeps its number, and motion of any other shape, such as
that of a mode which only a strong hit shows, hardly moves its pole. Gauss-Newton steps are taken in
poles s_r and participation l_ri; the real residuals v and u of each cell are projected out. Normal
equations are sums over cells of products of factors, times sums over lines of products of kernels.
"""

from dataclasses import dataclass, replace

import numpy as np

from identification.modal.shape_fit import (
    ModalFit,
    WeightedFrfs,
    build_kernels,
    reduced_chi_square,
)
from identification.words import Complex, Mask, Real

_MAX_POLE_STEPS = 30  # Gauss-Newton steps; a fit converges in some eight
_POLE_COST_TOLERANCE = 0.02  # drop of the cost at which a fit has converged, in units of the noise
_POLE_RIDGE = 1e-10  # of each diagonal entry of the normal matrix, for collinear columns


@dataclass(frozen=True, eq=False)
class PoleFit:
    """Poles that were fitted to FRFs at known shapes.

    Args:
        poles: s_r [rad/s]; (n_mode,).
        participation: l_r; (n_in, n_mode).
        covariance: of (Re s_r, Im s_r), by the noise or by the residual if that is larger;
            (n_mode, 2, 2).
        misfit: reduced chi-square.
        about: poles about which ``poles`` is a small change; None where ``poles`` are poles.
    """

    poles: Complex
    participation: Complex
    covariance: Real
    misfit: float
    about: Complex | None = None

    @property
    def freq_sd(self) -> Real:
        """Standard deviations of the natural frequencies [Hz]; (n_mode,)."""
        poles = self.poles if self.about is None else self.about
        unit = np.stack([poles.real, poles.imag], axis=1) / np.abs(poles)[:, None]
        return self._propagate(unit) / (2 * np.pi)

    @property
    def damping_sd(self) -> Real:
        """Standard deviations of the damping ratios -Re s / abs(s); (n_mode,)."""
        poles = self.poles if self.about is None else self.about
        real, imag, size = poles.real, poles.imag, np.abs(poles)[:, None] ** 3
        return self._propagate(np.stack([-(imag**2), real * imag], axis=1) / size)

    def _propagate(self, slopes: Real) -> Real:
        return np.sqrt(np.einsum("ma,mab,mb->m", slopes, self.covariance, slopes))


def fit_poles(data: WeightedFrfs, start: ModalFit, moving: Mask) -> PoleFit:
    """Fit poles and participation at the shapes of a modal model.

    Args:
        data: FRFs with separable weights.
        start: shapes, and poles and participation from which the fit begins.
        moving: modes whose poles vary; (n_mode,). The participation of all modes varies.
    """
    fitted, normal, right = _linearise(data, start, moving)
    damping = 1e-6
    for _ in range(_MAX_POLE_STEPS):
        scaled = _add_ridge(normal, damping + _POLE_RIDGE)
        step = np.asarray(np.linalg.solve(scaled, right), np.float64)
        candidate = _apply_step(fitted, step, moving)
        if (candidate.poles.imag > 0).all():
            refit, next_normal, next_right = _linearise(data, candidate, moving)
            if np.isfinite(refit.cost) and refit.cost <= fitted.cost:
                drop, damping = fitted.cost - refit.cost, damping / 10
                fitted, normal, right = refit, next_normal, next_right
                if drop <= _POLE_COST_TOLERANCE * reduced_chi_square(data, fitted):
                    break
                continue
        damping *= 10
        if damping > 1e6:
            break
    misfit = reduced_chi_square(data, fitted)
    return PoleFit(
        fitted.poles, fitted.participation, misfit * _pole_covariance(normal, moving), misfit
    )


def find_first_step(data: WeightedFrfs, model: ModalFit, moving: Mask) -> PoleFit:
    """Return the small change of poles and participation that explains a small change of FRFs.

    Args:
        data: change of the FRFs, with separable weights.
        model: poles, participation and shapes about which they change.
        moving: modes whose poles vary; (n_mode,). The participation of all modes varies.
    """
    nothing = np.zeros_like(data.cells)
    bare = replace(model, lower=nothing, upper=nothing)
    moved = replace(data, values=bare.values(data.laplace, data.order) + data.values)
    fitted, normal, right = _linearise(moved, bare, moving)
    step = np.linalg.solve(_add_ridge(normal, _POLE_RIDGE), right)
    after = _apply_step(fitted, np.asarray(step, np.float64), moving)
    misfit = reduced_chi_square(data, replace(fitted, cost=fitted.cost - float(right @ step)))
    return PoleFit(
        after.poles - model.poles,
        after.participation - model.participation,
        misfit * _pole_covariance(normal, moving),
        misfit,
        model.poles,
    )


def _add_ridge(normal: Real, share: float) -> Real:
    """Return a normal matrix with larger diagonal entries; those of no influence are one."""
    diagonal = np.diag(normal)
    return normal + np.diag(np.where(diagonal > 0, share * diagonal, 1.0))


def _pole_covariance(normal: Real, moving: Mask) -> Real:
    """Return the covariance of (Re s_r, Im s_r) by the noise alone; (n_mode, 2, 2)."""
    inverse = np.linalg.pinv(_add_ridge(normal, _POLE_RIDGE), hermitian=True)
    count = int(moving.sum())
    covariance = np.zeros((len(moving), 2, 2))
    places = np.stack([np.arange(count), count + np.arange(count)], axis=1)
    covariance[moving] = inverse[places[:, :, None], places[:, None, :]] / 2
    return covariance


def _apply_step(fitted: ModalFit, step: Real, moving: Mask) -> ModalFit:
    """Return a model after a step of Re s, Im s, Re l, Im l."""
    count, size = int(moving.sum()), fitted.participation.size
    poles = fitted.poles.copy()
    poles[moving] += step[:count] + 1j * step[count : 2 * count]
    change = step[2 * count : 2 * count + size] + 1j * step[2 * count + size :]
    participation = fitted.participation + change.reshape(fitted.participation.shape)
    return replace(fitted, poles=poles, participation=participation)


def _linearise(data: WeightedFrfs, model: ModalFit, moving: Mask) -> tuple[ModalFit, Real, Real]:
    """Return a model with its residuals and cost, its normal matrix and its right side."""
    kernels = build_kernels(data, model.poles)
    gram = kernels.conj().T @ (data.weights[:, 0] * kernels)
    fitted, projected = _fit_residuals(data, model, kernels, gram)
    first, second, factors = _build_columns(model, moving)
    cells = data.cells.reshape(-1, 1)
    right = (factors.conj() * projected[:, first] + factors * projected[:, second]).real
    products = (
        (cells * factors).conj().T @ factors,
        (cells * factors).conj().T @ factors.conj(),
    )
    normal = np.zeros((factors.shape[1],) * 2)
    for left, is_left_second in ((first, False), (second, True)):
        for right_kernels, is_right_second in ((first, False), (second, True)):
            product = products[int(is_left_second != is_right_second)]
            product = product.conj() if is_left_second else product
            normal += (product * gram[np.ix_(left, right_kernels)]).real
    ends = _residual_kernels(model)
    cross = (factors[:, None] * gram[ends][:, first]).real
    cross += (factors.conj()[:, None] * gram[ends][:, second]).real
    solved = np.linalg.solve(gram[np.ix_(ends, ends)].real, cross)
    normal -= np.einsum("c,cap,caq->pq", cells[:, 0], cross, solved, optimize=True)
    return fitted, normal, (cells * right).sum(axis=0)


def _residual_kernels(model: ModalFit) -> list[int]:
    """Return the numbers of the kernels of u and v."""
    return [4 * len(model.poles), 4 * len(model.poles) + 1]


def _fit_residuals(
    data: WeightedFrfs, model: ModalFit, kernels: Complex, gram: Complex
) -> tuple[ModalFit, Complex]:
    """Return a model with fitted residuals, and the kernels' products with the error."""
    nothing = np.zeros_like(data.cells)
    bare = replace(model, lower=nothing, upper=nothing)
    error = (data.values - bare.values(data.laplace, data.order)).reshape(len(kernels), -1)
    projected = (kernels.conj().T @ (data.weights[:, 0] * error)).T
    ends = _residual_kernels(model)
    residuals = np.linalg.solve(gram[np.ix_(ends, ends)].real, projected[:, ends].real.T)
    off = error - kernels[:, ends] @ residuals
    cost = float((np.abs(off) ** 2 * data.weights[:, 0] * data.cells.ravel()).sum())
    upper, lower = np.asarray(residuals, np.float64).reshape(2, *data.cells.shape)
    fitted = replace(bare, lower=lower, upper=upper, cost=cost)
    return fitted, projected - residuals.T @ gram[:, ends].T


def _build_columns(model: ModalFit, moving: Mask) -> tuple[list[int], list[int], Complex]:
    """Return the kernels of each parameter, and the factor of the first one in each cell.

    The factor of the second kernel is its conjugate.

    Returns:
        Numbers of both kernels, and factors (n_out n_in, n_parameter), of Re s, Im s, Re l, Im l.
    """
    m, (n_in, _) = len(model.poles), model.participation.shape
    n_out = len(model.shapes)
    chosen = np.flatnonzero(moving)
    residues = (model.shapes[:, None] * model.participation).reshape(-1, m)[:, chosen]
    shapes = np.zeros((n_out, n_in, n_in, m), complex)
    shapes[:, np.arange(n_in), np.arange(n_in)] = model.shapes[:, None]
    flat = shapes.reshape(n_out * n_in, n_in * m)
    factors = np.hstack([residues, 1j * residues, flat, 1j * flat])
    of_poles, of_rows = [*chosen, *chosen], [*range(m)] * (2 * n_in)
    first = [int(2 * m + k) for k in of_poles] + of_rows
    second = [int(3 * m + k) for k in of_poles] + [m + k for k in of_rows]
    return first, second, factors
