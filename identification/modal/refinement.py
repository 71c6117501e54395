r"""Poles, participation, shapes and residuals fitted together to FRFs, weighted by variance.

    H_oi(s) = s^q [ sum_r (phi_or l_ri / (s - s_r) + its conjugate) + v_oi / s^2 + u_oi ]

with s = i w, q = 0, 1, 2 for receptance, mobility, accelerance, and the residuals v, u of modes
below and above the band, real (Ewins 2000, ch. 4). Given poles s_r and participation l_r all else
is linear, output by output (least-squares frequency domain, LSFD). So each step of Gauss and
Newton is taken in poles and participation alone, the shapes eliminated block by block (variable
projection, Golub and Pereyra 1973): exact, since the normal equations of an output only hold sums
over lines of products of the 4 m + 2 kernels s^q / (s - s_r), its square, their conjugate twins,
s^q and s^(q - 2).

The largest participation of each mode is held, since phi_r c and l_r / c are the same mode.
"""

from dataclasses import dataclass, replace

import numpy as np

from identification.words import Complex, HasPoles, Integers, Mask, Real, modal_sum

_STEPS = 40
_SETTLED = 0.02  # drop of the cost at which a fit has settled: with weights of one over the
# variance, a parameter one standard deviation off costs a half
_RIDGE = 1e-12  # of each diagonal, where data do not tell two columns apart


@dataclass(frozen=True, eq=False)
class Data:
    """FRFs and how well they are known.

    Args:
        laplace: s of every line; (n_freq,).
        order: q.
        values: H, zero where not measured; (n_freq, n_out, n_in).
        weights: one over the variance, zero where not measured; (n_freq, n_out, n_in), or
            (n_freq, 1, 1) times ``cells`` if they are separable.
        cells: (n_out, n_in) weights of the cells beside those of the lines.
        alike: lines whose errors are so alike that they tell as much as one; the weights have it
            in them.
    """

    laplace: Complex
    order: int
    values: Complex
    weights: Real
    cells: Real
    alike: float = 1.0

    @property
    def separable(self) -> bool:
        """Whether all cells weigh the lines alike."""
        return self.weights.shape[1:] == (1, 1)


@dataclass(frozen=True, eq=False)
class ModalFit(HasPoles):
    """A modal model of measured FRFs.

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
        """H; (n_freq, n_out, n_in)."""
        return modal_sum(self, laplace, order)


def kernels(data: Data, poles: Complex) -> Complex:
    """s^q / (s - s_r), its twin, their squares, s^q, s^(q-2); (n_freq, 4 m + 2)."""
    s = data.laplace[:, None]
    scale = s**data.order
    away, twin = 1.0 / (s - poles), 1.0 / (s - poles.conj())
    columns: Complex = np.hstack(
        [scale * k for k in (away, twin, away**2, twin**2)] + [scale, s ** (data.order - 2)]
    )
    return columns


class _Sums:
    """Sums over lines of products of kernels with one another and with the data."""

    def __init__(self, data: Data, poles: Complex) -> None:
        self.data = data
        self.kernels = kernels(data, poles)
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
        """K^H W h of every cell; (n_out, n_in, 4 m + 2)."""
        if self.data.separable:  # the lines' weights are in the kernels
            summed = self.weighted @ values.reshape(len(values), -1)
        else:
            summed = self.kernels.conj().T @ (values * self.data.weights).reshape(len(values), -1)
        projected: Complex = summed.T.reshape(*values.shape[1:], -1)
        return projected


def _linear_frame(participation: Complex) -> Complex:
    """Kernels to the columns of Re phi, Im phi, v, u; (n_in, 4 m + 2, 2 m + 2 n_in)."""
    n_in, m = participation.shape
    frame = np.zeros((n_in, 4 * m + 2, 2 * m + 2 * n_in), complex)
    mode = np.arange(m)
    for inp, own in enumerate(participation):
        frame[inp, mode, mode] = own
        frame[inp, m + mode, mode] = own.conj()
        frame[inp, mode, m + mode] = 1j * own
        frame[inp, m + mode, m + mode] = -1j * own.conj()
        frame[inp, 4 * m, 2 * m + n_in + inp] = 1.0
        frame[inp, 4 * m + 1, 2 * m + inp] = 1.0
    return frame


def fit_shapes(data: Data, poles: Complex, participation: Complex) -> ModalFit:
    """Shapes and residuals by linear least squares (LSFD).

    Args:
        data: FRFs and weights.
        poles: (n_mode,).
        participation: (n_in, n_mode).

    Returns:
        The fit with these poles and participation.
    """
    fitted, _ = _fit_shapes(data, poles, participation)
    return fitted


def _fit_shapes(data: Data, poles: Complex, participation: Complex) -> tuple[ModalFit, "_Linear"]:
    sums = _Sums(data, poles)
    frame = _linear_frame(participation)
    normal = _normal(data, sums, frame)
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
    return replace(fitted, cost=cost), _Linear(sums, frame, normal, error)


@dataclass(frozen=True, eq=False)
class _Linear:
    """What the linear fit leaves for the nonlinear one."""

    sums: _Sums
    frame: Complex
    normal: Real
    error: Complex


def _normal(data: Data, sums: _Sums, frame: Complex) -> Real:
    """Normal equations of the shapes of every output; (n_out, n_b, n_b)."""
    if data.separable:
        inner = np.stack([(own.conj().T @ sums.grams[0, 0] @ own).real for own in frame])
        normal: Real = np.einsum("oi,iab->oab", data.cells, inner)
    else:
        normal = np.zeros((len(data.cells), frame.shape[2], frame.shape[2]))
        for inp, own in enumerate(frame):
            grams = sums.grams[:, inp] * data.cells[:, inp, None, None]
            normal += (own.conj().T @ grams @ own).real
    diagonal = np.arange(normal.shape[1])
    normal[:, diagonal, diagonal] *= 1 + _RIDGE
    empty = normal[:, diagonal, diagonal] == 0
    normal[:, diagonal, diagonal] += empty
    return normal


@dataclass(frozen=True, eq=False)
class _Free:
    """What varies beside the shapes: poles, and participation but for the largest of a mode.

    Args:
        poles: numbers of those that vary; (n_pole,).
        inputs, modes: of the participations that vary; (n_free,).
    """

    poles: Integers
    inputs: Integers
    modes: Integers

    @property
    def size(self) -> int:
        """Real numbers: Re s, Im s, Re l, Im l."""
        return 2 * len(self.poles) + 2 * len(self.inputs)


def _free(participation: Complex, moving: Mask, turning: Mask) -> _Free:
    """Poles of the modes that may move, participation of those that may turn; (n_mode,) each."""
    largest = np.abs(participation).argmax(axis=0)
    inputs, modes = np.nonzero((np.arange(len(participation))[:, None] != largest) & turning)
    return _Free(np.flatnonzero(moving), inputs, modes)


@dataclass(frozen=True, eq=False)
class _Curves:
    """Columns of Re s, Im s, Re l, Im l for one input: two kernels each, with their factors.

    Args:
        columns: which parameters move this input; (n_own,).
        shared: how many of them, the first, move the other inputs too.
        first, second: kernels; (n_own,).
        one, other: their factors for each output; (n_out, n_own).
    """

    columns: Integers
    shared: int
    first: Integers
    second: Integers
    one: Complex
    other: Complex

    @property
    def pairs(self) -> tuple[tuple[Integers, Complex], tuple[Integers, Complex]]:
        """Kernels with factors, twice."""
        return (self.first, self.one), (self.second, self.other)


def _curves(fitted: ModalFit, free: _Free, inp: int) -> _Curves:
    m, k, count = len(fitted.poles), len(free.poles), len(free.inputs)
    place, mode, own = np.arange(k), free.poles, np.flatnonzero(free.inputs == inp)
    turned = free.modes[own]
    residue = fitted.shapes[:, mode] * fitted.participation[inp, mode]
    shape = fitted.shapes[:, turned]
    one = np.hstack([residue, 1j * residue, shape, 1j * shape])
    return _Curves(
        np.concatenate([place, k + place, 2 * k + own, 2 * k + count + own]),
        2 * k,
        np.concatenate([2 * m + mode, 2 * m + mode, turned, turned]),
        np.concatenate([3 * m + mode, 3 * m + mode, m + turned, m + turned]),
        one,
        one.conj(),
    )


def _schur(data: Data, fitted: ModalFit, linear: _Linear, free: _Free) -> tuple[Real, Real]:
    """Normal matrix and right side of poles and participation, shapes eliminated."""
    size = free.size
    curved = np.zeros((size, size))
    crossed = np.zeros((len(data.cells), linear.frame.shape[2], size))
    right = np.zeros(size)
    projected = linear.sums.project(linear.error)
    for inp in range(len(fitted.participation)):
        own = _curves(fitted, free, inp)
        weight = data.cells[:, inp, None]
        grams = linear.sums.grams[:1, inp] if data.separable else linear.sums.grams[:, inp]
        adjoint = linear.frame[inp].conj().T
        one, other = adjoint @ grams[:, :, own.first], adjoint @ grams[:, :, own.second]
        _cross(crossed, own, (weight * own.one), (one.real + other.real, other.imag - one.imag))
        for kernel, factor in own.pairs:
            right[own.columns] += (weight * factor.conj() * projected[:, inp, kernel]).real.sum(0)
            for twins, twin in own.pairs:
                gram = grams[:, kernel[:, None], twins]
                if data.separable:
                    product = ((weight * factor).conj().T @ twin) * gram[0]
                else:
                    product = np.einsum("op,oq,opq->pq", (weight * factor).conj(), twin, gram)
                curved[np.ix_(own.columns, own.columns)] += product.real
    solved = np.linalg.solve(linear.normal, crossed)
    return curved - crossed.reshape(-1, size).T @ solved.reshape(-1, size), right


def _cross(crossed: Real, own: _Curves, factor: Complex, parts: tuple[Real, Real]) -> None:
    """Add Re (one f + other conj f), in real numbers and output by output: the longest sum of all.

    Args:
        crossed: normal equations between shapes and curves; (n_out, n_b, size).
        own: curves of one input.
        factor: f; (n_out, n_own).
        parts: Re one + Re other, Im other - Im one; (1 or n_out, n_b, n_own).
    """
    poles, rest = own.shared, own.columns[own.shared :]
    for out, (real, imag) in enumerate(zip(factor.real, factor.imag, strict=True)):
        first, second = (part[min(out, len(part) - 1)] for part in parts)
        added = first * real
        added += second * imag
        crossed[out, :, :poles] += added[:, :poles]
        crossed[out, :, rest] = added[:, poles:].T


def contradiction(data: Data, fitted: ModalFit) -> float:
    """Cost per value, 1 at least: what is below it in the cost, noise or model errors can make."""
    values = int((data.cells > 0).sum()) * len(data.laplace)
    return max(1.0, fitted.cost * data.alike / values)


def weighted_error(data: Data, fitted: ModalFit) -> Complex:
    """What a fit leaves, over its standard deviation; (n_freq, n_out, n_in)."""
    error: Complex = data.values - fitted.values(data.laplace, data.order)
    return np.asarray(error * np.sqrt(data.weights * data.cells))


def cost_without(data: Data, fitted: ModalFit) -> Real:
    """How much the cost would rise without each mode, shapes of the others fitted again; (n_mode,).

    Leaving columns S out of a least-squares fit with normal matrix G and solution x raises the
    cost by x_S' [(G^-1)_SS]^-1 x_S.
    """
    again, linear = _fit_shapes(data, fitted.poles, fitted.participation)
    inverse = np.linalg.inv(linear.normal)
    m = len(fitted.poles)
    pairs = np.stack([np.arange(m), m + np.arange(m)], axis=1)
    blocks = inverse[:, pairs[:, :, None], pairs[:, None, :]]
    parts = np.stack([again.shapes.real, again.shapes.imag], axis=-1)
    solved = np.linalg.solve(blocks, parts[..., None])[..., 0]
    rise: Real = (parts * solved).sum(axis=(0, 2))
    return rise


def refine(
    data: Data,
    poles: Complex,
    participation: Complex,
    *,
    settled: float = _SETTLED,
    steps: int = _STEPS,
    held: Mask | None = None,
    only: Mask | None = None,
) -> tuple[ModalFit, Real]:
    """Fit poles, participation, shapes and residuals together.

    Gauss-Newton steps, damped (Levenberg and Marquardt) where a step does not lower the cost.

    Args:
        data: FRFs and weights.
        poles: where to start; (n_mode,).
        participation: likewise; (n_in, n_mode).
        settled: drop of the cost in one step at which to stop, in units of the noise or, where
            that is more, of what the fit leaves.
        steps: at most.
        held: poles that stay where they are; (n_mode,).
        only: modes of which pole and participation vary, the shapes of all; (n_mode,).

    Returns:
        The fit, and the normal matrix of (Re s, Im s, Re l, Im l) with the shapes eliminated, of
        what varies: with weights of one over the variance, half its inverse is their covariance.
    """
    turning = np.ones(len(poles), bool) if only is None else only
    moving = turning if held is None else turning & ~held
    fitted, linear = _fit_shapes(data, poles, participation)
    if not len(poles):
        return fitted, np.zeros((0, 0))
    damping = 1e-6
    free = _free(participation, moving, turning)
    matrix, right = _schur(data, fitted, linear, free)
    for _ in range(steps if free.size else 0):
        scaled = matrix + damping * np.diag(np.diag(matrix))
        step = np.asarray(np.linalg.solve(scaled, right), np.float64)
        moved = _moved(fitted, step, free)
        after, linear = _fit_shapes(data, *moved)
        if np.isfinite(after.cost) and after.cost <= fitted.cost and (after.poles.imag > 0).all():
            ends = fitted.cost - after.cost <= settled * contradiction(data, after)
            fitted, damping = after, damping / 10
            free = _free(fitted.participation, moving, turning)
            matrix, right = _schur(data, fitted, linear, free)
            if ends:
                break
        else:
            damping *= 10
            if damping > 1e6:
                break
    return fitted, matrix


def _moved(fitted: ModalFit, step: Real, free: _Free) -> tuple[Complex, Complex]:
    k, count = len(free.poles), len(free.inputs)
    poles, participation = fitted.poles.copy(), fitted.participation.copy()
    poles[free.poles] += step[:k] + 1j * step[k : 2 * k]
    participation[free.inputs, free.modes] += (
        step[2 * k : 2 * k + count] + 1j * step[2 * k + count :]
    )
    return poles, participation
