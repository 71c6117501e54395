"""Joint fit of poles, participation, shapes and residuals to FRFs, weighted by their variance.

Given poles and participation all else is linear, output by output (``shape_fit.py``). Each
Gauss-Newton step is therefore taken in poles and participation alone, with the shapes eliminated by
the Schur complement (variable projection, Golub and Pereyra 1973). This is exact, since the normal
equations of an output are sums over lines of products of kernels.

The largest participation of each mode is fixed, since phi_r c and l_r / c are the same mode. Where
inputs share no output, as in tests with other sensors, it is fixed for each of these groups.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components

from identification.modal.shape_fit import (
    LinearFit,
    ModalFit,
    WeightedFrfs,
    fit_shapes_with_sums,
    reduced_chi_square,
)
from identification.words import Complex, Integers, Mask, Real

_MAX_REFINE_STEPS = 40  # Gauss-Newton steps; a fit converges in some ten
# Drop of the cost in one step at which a fit has converged. With weights of one over the
# variance, a parameter one standard deviation off its optimum costs 0.5.
_COST_TOLERANCE = 0.02


@dataclass(frozen=True, eq=False)
class _FreeParameters:
    """Nonlinear parameters that vary: poles, and all but the largest participation of each mode.

    Args:
        poles: numbers of the poles that vary; (n_pole,).
        inputs, modes: input and mode of each participation that varies; (n_free,).
    """

    poles: Integers
    inputs: Integers
    modes: Integers

    @property
    def size(self) -> int:
        """Number of real parameters: Re s, Im s, Re l, Im l."""
        return 2 * len(self.poles) + 2 * len(self.inputs)


def _free_parameters(
    data: WeightedFrfs, participation: Complex, moving_poles: Mask, moving_rows: Mask
) -> _FreeParameters:
    """List the parameters that vary.

    Args:
        moving_poles: modes whose poles vary; (n_mode,).
        moving_rows: modes whose participation varies; (n_mode,).
    """
    is_measured = data.cells > 0
    count, groups = connected_components(is_measured.T.astype(int) @ is_measured)
    is_fixed, every = np.zeros(participation.shape, bool), np.arange(participation.shape[1])
    for members in (np.flatnonzero(groups == group) for group in range(count)):
        is_fixed[members[np.abs(participation[members]).argmax(axis=0)], every] = True
    inputs, modes = np.nonzero(~is_fixed & moving_rows)
    return _FreeParameters(np.flatnonzero(moving_poles), inputs, modes)


@dataclass(frozen=True, eq=False)
class _ParameterColumns:
    """Jacobian columns of Re s, Im s, Re l, Im l for one input: two kernels and their factors.

    Args:
        columns: numbers of the parameters that affect this input; (n_own,).
        shared: how many of them, the first, affect the other inputs too.
        first, second: numbers of the kernels; (n_own,).
        first_factor, second_factor: their factors for each output; (n_out, n_own).
    """

    columns: Integers
    shared: int
    first: Integers
    second: Integers
    first_factor: Complex
    second_factor: Complex

    @property
    def pairs(self) -> tuple[tuple[Integers, Complex], tuple[Integers, Complex]]:
        """Both kernels with their factors."""
        return (self.first, self.first_factor), (self.second, self.second_factor)


def _parameter_columns(fitted: ModalFit, free: _FreeParameters, inp: int) -> _ParameterColumns:
    """Build the Jacobian columns of one input."""
    m, k, count = len(fitted.poles), len(free.poles), len(free.inputs)
    pole, mode, number = np.arange(k), free.poles, np.flatnonzero(free.inputs == inp)
    mode_of = free.modes[number]
    residue = fitted.shapes[:, mode] * fitted.participation[inp, mode]
    shape = fitted.shapes[:, mode_of]
    factor = np.hstack([residue, 1j * residue, shape, 1j * shape])
    return _ParameterColumns(
        np.concatenate([pole, k + pole, 2 * k + number, 2 * k + count + number]),
        2 * k,
        np.concatenate([2 * m + mode, 2 * m + mode, mode_of, mode_of]),
        np.concatenate([3 * m + mode, 3 * m + mode, m + mode_of, m + mode_of]),
        factor,
        factor.conj(),
    )


def _schur_complement(
    data: WeightedFrfs, fitted: ModalFit, linear: LinearFit, free: _FreeParameters
) -> tuple[Real, Real]:
    """Compute normal matrix and right side of poles and participation, shapes eliminated."""
    size = free.size
    matrix = np.zeros((size, size))
    cross = np.zeros((len(data.cells), linear.frame.shape[2], size))
    right = np.zeros(size)
    projected = linear.sums.project(linear.error)
    for inp in range(len(fitted.participation)):
        jacobian = _parameter_columns(fitted, free, inp)
        weight = data.cells[:, inp, None]
        grams = linear.sums.grams[:1, inp] if data.separable else linear.sums.grams[:, inp]
        adjoint = linear.frame[inp].conj().T
        first, second = (
            adjoint @ grams[:, :, jacobian.first],
            adjoint @ grams[:, :, jacobian.second],
        )
        _add_cross_terms(
            cross,
            jacobian,
            (weight * jacobian.first_factor),
            (first.real + second.real, second.imag - first.imag),
        )
        for kernel, factor in jacobian.pairs:
            right[jacobian.columns] += (
                weight * factor.conj() * projected[:, inp, kernel]
            ).real.sum(0)
            for twins, twin in jacobian.pairs:
                gram = grams[:, kernel[:, None], twins]
                if data.separable:
                    product = ((weight * factor).conj().T @ twin) * gram[0]
                else:
                    product = np.einsum("op,oq,opq->pq", (weight * factor).conj(), twin, gram)
                matrix[np.ix_(jacobian.columns, jacobian.columns)] += product.real
    solved = np.linalg.solve(linear.normal, cross)
    return matrix - cross.reshape(-1, size).T @ solved.reshape(-1, size), right


def _add_cross_terms(
    cross: Real, jacobian: _ParameterColumns, factor: Complex, parts: tuple[Real, Real]
) -> None:
    """Add Re (first f + second conj f) in real numbers, output by output; this is the largest sum.

    Args:
        cross: normal equations between shapes and nonlinear parameters; (n_out, n_b, size).
        jacobian: Jacobian columns of one input.
        factor: f; (n_out, n_own).
        parts: Re first + Re second, Im second - Im first; (1 or n_out, n_b, n_own).
    """
    poles, unshared = jacobian.shared, jacobian.columns[jacobian.shared :]
    for out, (real, imag) in enumerate(zip(factor.real, factor.imag, strict=True)):
        first, second = (part[min(out, len(part) - 1)] for part in parts)
        term = first * real
        term += second * imag
        cross[out, :, :poles] += term[:, :poles]
        cross[out, :, unshared] = term[:, poles:].T


def refine(
    data: WeightedFrfs,
    poles: Complex,
    participation: Complex,
    *,
    cost_tolerance: float = _COST_TOLERANCE,
    max_steps: int = _MAX_REFINE_STEPS,
    fixed: Mask | None = None,
    free_modes: Mask | None = None,
) -> tuple[ModalFit, Real]:
    """Fit poles, participation, shapes and residuals together.

    Gauss-Newton steps are damped (Levenberg-Marquardt) where a step does not lower the cost.

    Args:
        poles: start values [rad/s]; (n_mode,).
        participation: start values; (n_in, n_mode).
        cost_tolerance: drop of the cost in one step at which to stop, in units of the noise or of
            the reduced chi-square if that is more.
        max_steps: number of steps, at most.
        fixed: poles that do not vary; (n_mode,).
        free_modes: modes whose pole and participation vary, all if None; (n_mode,). The shapes of
            all modes vary.

    Returns:
        The fit, and the normal matrix of the varying (Re s, Im s, Re l, Im l) with the shapes
            eliminated. With weights of one over the variance, half its inverse is their covariance.
    """
    moving_rows = np.ones(len(poles), bool) if free_modes is None else free_modes
    moving_poles = moving_rows if fixed is None else moving_rows & ~fixed
    fitted, linear = fit_shapes_with_sums(data, poles, participation)
    if not len(poles):
        return fitted, np.zeros((0, 0))
    damping = 1e-6
    free = _free_parameters(data, participation, moving_poles, moving_rows)
    matrix, right = _schur_complement(data, fitted, linear, free)
    for _ in range(max_steps if free.size else 0):
        scaled = matrix + damping * np.diag(np.diag(matrix))
        step = np.asarray(np.linalg.solve(scaled, right), np.float64)
        candidate = _apply_step(fitted, step, free)
        refit, linear = fit_shapes_with_sums(data, *candidate)
        if np.isfinite(refit.cost) and refit.cost <= fitted.cost and (refit.poles.imag > 0).all():
            has_converged = fitted.cost - refit.cost <= cost_tolerance * reduced_chi_square(
                data, refit
            )
            fitted, damping = refit, damping / 10
            free = _free_parameters(data, fitted.participation, moving_poles, moving_rows)
            matrix, right = _schur_complement(data, fitted, linear, free)
            if has_converged:
                break
        else:
            damping *= 10
            if damping > 1e6:
                break
    return fitted, matrix


def _apply_step(fitted: ModalFit, step: Real, free: _FreeParameters) -> tuple[Complex, Complex]:
    """Return poles and participation after a step."""
    k, count = len(free.poles), len(free.inputs)
    poles, participation = fitted.poles.copy(), fitted.participation.copy()
    poles[free.poles] += step[:k] + 1j * step[k : 2 * k]
    participation[free.inputs, free.modes] += (
        step[2 * k : 2 * k + count] + 1j * step[2 * k + count :]
    )
    return poles, participation
