"""Joint fit of poles, participation, shapes and residuals to FRFs, weighted by their variance.

    H_oi(s) = s^q [ sum_r (phi_or l_ri / (s - s_r) + its conjugate) + v_oi / s^2 + u_oi ]

with s = i w and q = 0, 1, 2 for receptance, mobility, accelerance. The real residuals v and u stand
for modes below and above the band (Ewins 2000, ch. 4). Given poles s_r and participation l_r all
else is linear, output by output (least-squares frequency domain, LSFD). Each Gauss-Newton step is
therefore taken in poles and participation alone, with the shapes eliminated by the Schur complement
(variable projection, Golub and Pereyra 1973). This is exact, since the normal equations of an
output are sums over lines of products of 4 m + 2 kernels. The kernels are s^q / (s - s_r), its
square, their conjugates, s^q and s^(q - 2).

The largest participation of each mode is fixed, since phi_r c and l_r / c are the same mode.
"""

from dataclasses import dataclass, replace

import numpy as np

from identification.words import Complex, HasPoles, Integers, Mask, Real, modal_sum

_MAX_REFINE_STEPS = 40  # Gauss-Newton steps; a fit converges in some ten
# Drop of the cost in one step at which a fit has converged. With weights of one over the
# variance, a parameter one standard deviation off its optimum costs 0.5.
_COST_TOLERANCE = 0.02
# Added to each diagonal entry of a normal matrix, relative to it, for collinear columns.
_NORMAL_RIDGE = 1e-12


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
    columns: Complex = np.hstack(
        [scale * k for k in (away, twin, away**2, twin**2)] + [scale, s ** (data.order - 2)]
    )
    return columns


class _KernelSums:
    """Sums over lines of products of kernels with each other and with the data."""

    def __init__(self, data: WeightedFrfs, poles: Complex) -> None:
        self.data = data
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
        projected: Complex = summed.T.reshape(*values.shape[1:], -1)
        return projected


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
        data: FRFs and weights.
        poles: (n_mode,).
        participation: (n_in, n_mode).

    Returns:
        The fit with these poles and participation.
    """
    fitted, _ = _fit_shapes(data, poles, participation)
    return fitted


def _fit_shapes(
    data: WeightedFrfs, poles: Complex, participation: Complex
) -> tuple[ModalFit, "_LinearFit"]:
    """Fit shapes and residuals, and return the intermediate results of the linear fit too."""
    sums = _KernelSums(data, poles)
    frame = _linear_frame(participation)
    normal = _normal_matrices_of_outputs(data, sums, frame)
    right = np.einsum(
        "oi,ikb,oik->ob", data.cells, frame.conj(), sums.project(data.values), optimize=True
    ).real
    solution = np.linalg.solve(normal, right[:, :, None])[:, :, 0]
    m, n_in = len(poles), len(participation)
    shapes = solution[:, :m] + 1j * solution[:, m : 2 * m]
    lower, upper = solution[:, 2 * m : 2 * m + n_in], solution[:, 2 * m + n_in :]
    fitted = ModalFit(poles, participation, shapes, lower, upper, 0.0)
    error = data.values - fitted.values(data.laplace, data.order)
    cost = float((np.abs(error) ** 2 * data.weights * data.cells).sum())
    return replace(fitted, cost=cost), _LinearFit(sums, frame, normal, error)


@dataclass(frozen=True, eq=False)
class _LinearFit:
    """Intermediate results of the linear fit that the nonlinear fit uses."""

    sums: _KernelSums
    frame: Complex
    normal: Real
    error: Complex


def _normal_matrices_of_outputs(data: WeightedFrfs, sums: _KernelSums, frame: Complex) -> Real:
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
    participation: Complex, moving_poles: Mask, moving_rows: Mask
) -> _FreeParameters:
    """List the parameters that vary.

    Args:
        participation: (n_in, n_mode).
        moving_poles: modes whose poles vary; (n_mode,).
        moving_rows: modes whose participation varies; (n_mode,).
    """
    largest = np.abs(participation).argmax(axis=0)
    inputs, modes = np.nonzero((np.arange(len(participation))[:, None] != largest) & moving_rows)
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
    data: WeightedFrfs, fitted: ModalFit, linear: _LinearFit, free: _FreeParameters
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
    refitted, linear = _fit_shapes(data, fitted.poles, fitted.participation)
    inverse = np.linalg.inv(linear.normal)
    m = len(fitted.poles)
    pairs = np.stack([np.arange(m), m + np.arange(m)], axis=1)
    blocks = inverse[:, pairs[:, :, None], pairs[:, None, :]]
    parts = np.stack([refitted.shapes.real, refitted.shapes.imag], axis=-1)
    solved = np.linalg.solve(blocks, parts[..., None])[..., 0]
    rise: Real = (parts * solved).sum(axis=(0, 2))
    return rise


def shape_deviations(data: WeightedFrfs, fitted: ModalFit) -> Real:
    """Compute the standard deviations of the shapes at given poles and participation.

    With weights of one over the variance, half the inverse of the normal matrix of an output is the
    covariance of real and imaginary parts.

    Returns:
        sqrt(E|error|^2) of each entry; (n_out, n_mode).
    """
    _, linear = _fit_shapes(data, fitted.poles, fitted.participation)
    m = len(fitted.poles)
    variances = np.diagonal(np.linalg.inv(linear.normal), axis1=1, axis2=2)[:, : 2 * m] / 2
    deviation: Real = np.sqrt(np.maximum(variances[:, :m] + variances[:, m:], 0.0))
    return deviation


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
        data: FRFs and weights.
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
    fitted, linear = _fit_shapes(data, poles, participation)
    if not len(poles):
        return fitted, np.zeros((0, 0))
    damping = 1e-6
    free = _free_parameters(participation, moving_poles, moving_rows)
    matrix, right = _schur_complement(data, fitted, linear, free)
    for _ in range(max_steps if free.size else 0):
        scaled = matrix + damping * np.diag(np.diag(matrix))
        step = np.asarray(np.linalg.solve(scaled, right), np.float64)
        candidate = _apply_step(fitted, step, free)
        refit, linear = _fit_shapes(data, *candidate)
        if np.isfinite(refit.cost) and refit.cost <= fitted.cost and (refit.poles.imag > 0).all():
            has_converged = fitted.cost - refit.cost <= cost_tolerance * reduced_chi_square(
                data, refit
            )
            fitted, damping = refit, damping / 10
            free = _free_parameters(fitted.participation, moving_poles, moving_rows)
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
