"""How many modes there are, and how alike and how real their shapes are."""

from collections.abc import Sequence

import numpy as np
import scipy.optimize

from identification.modal.lscf_method import Poles
from identification.words import Complex, Integers, Real

NOT_PHYSICAL, NEW, FREQUENCY, DAMPING, STABLE = range(5)  # of a pole beside the order below


def cmif(values: Complex) -> Real:
    """Complex mode indicator function: squared singular values of H (seed, eq. 3.1 and 3.2).

    Args:
        values: FRFs; (n_freq, n_out, n_in).

    Returns:
        Largest first; (n_freq, n_in), or n_out if that is less.
    """
    return np.asarray(np.linalg.svd(values, compute_uv=False) ** 2, np.float64)


def mmif(values: Complex) -> Real:
    """Multivariate mode indicator function of accelerances or receptances.

    The force patterns f that make the motion as much out of phase as can be:
    min f' Re H' Re H f / f' (Re H' Re H + Im H' Im H) f, zero at an undamped resonance of real
    modes (Williams, Crowley and Vold 1985).

    Args:
        values: FRFs whose resonances are imaginary; (n_freq, n_out, n_in).

    Returns:
        Smallest first, 0 .. 1; (n_freq, n_in).
    """
    parts = [np.swapaxes(part, 1, 2) @ part for part in (values.real, values.imag)]
    real, total = parts[0], parts[0] + parts[1]
    size = np.trace(total, axis1=1, axis2=2)[:, None, None]
    silent = size == 0  # a line without motion is none of a mode: 1
    total = np.where(silent, np.eye(total.shape[1]), total + 1e-12 * size * np.eye(total.shape[1]))
    half = np.linalg.inv(np.linalg.cholesky(total))
    found: Real = np.linalg.eigvalsh(half @ np.where(silent, total, real) @ np.swapaxes(half, 1, 2))
    return found


def mac(one: Complex, other: Complex) -> Real:
    """Modal assurance criterion |a^H b|^2 / (a^H a b^H b) of every pair; (n_one, n_other).

    Args:
        one: shapes in columns; (n, n_one).
        other: likewise; (n, n_other).
    """
    product = np.abs(one.conj().T @ other) ** 2
    sizes = np.outer((np.abs(one) ** 2).sum(axis=0), (np.abs(other) ** 2).sum(axis=0))
    criterion: Real = product / np.where(sizes > 0, sizes, 1.0)
    return criterion


def auto_mac(shapes: Complex) -> Real:
    """MAC of every shape with every other; (n_mode, n_mode)."""
    return mac(shapes, shapes)


def frac(one: Complex, other: Complex) -> Real:
    """Frequency response assurance criterion |a^H b|^2 / (a^H a b^H b) of FRFs one by one.

    As MAC, over lines (Heylen and Lammens 1996); zero where one of both vanishes.

    Args:
        one: FRFs; (n_freq, ...).
        other: likewise.

    Returns:
        0 .. 1; without the first axis.
    """
    product = np.abs((one.conj() * other).sum(axis=0))
    sizes = [np.linalg.norm(values, axis=0) for values in (one, other)]
    first, second = (np.where(size > 0, size, 1.0) for size in sizes)
    criterion: Real = (product / first / second) ** 2
    return criterion


def comac(one: Complex, other: Complex) -> Real:
    """Coordinate MAC of paired shapes: agreement of each degree of freedom over all modes; (n,).

    (sum_r |a_r b_r|)^2 / (sum |a_r|^2 sum |b_r|^2) (Lieven and Ewins 1988).
    """
    product = (np.abs(one * other)).sum(axis=1) ** 2
    sizes = (np.abs(one) ** 2).sum(axis=1) * (np.abs(other) ** 2).sum(axis=1)
    criterion: Real = product / np.where(sizes > 0, sizes, 1.0)
    return criterion


def mpc(shapes: Complex) -> Real:
    """Modal phase collinearity: 1 where a shape is real but for one phase; (n_mode,).

    With S the covariance of real and imaginary parts, the squared ratio of difference and sum of
    its eigenvalues (Pappa, Elliott and Schenk 1993).
    """
    xx = (shapes.real**2).sum(axis=0)
    yy = (shapes.imag**2).sum(axis=0)
    xy = (shapes.real * shapes.imag).sum(axis=0)
    total = xx + yy
    collinear: Real = ((xx - yy) ** 2 + 4 * xy**2) / np.where(total > 0, total, 1.0) ** 2
    return collinear


def mpd(shapes: Complex) -> Real:
    """Mean phase deviation from the line through the shape's points, weighted by size [rad].

    Args:
        shapes: in columns; (n, n_mode).

    Returns:
        (n_mode,).
    """
    deviations = np.zeros(shapes.shape[1])
    for mode, shape in enumerate(shapes.T):
        _, _, rows = np.linalg.svd(np.column_stack([shape.real, shape.imag]))
        along = np.abs(shape.real * rows[0, 0] + shape.imag * rows[0, 1])
        size = np.abs(shape)
        if size.any():
            angle = np.arccos(np.clip(along / np.where(size > 0, size, 1.0), 0.0, 1.0))
            deviations[mode] = (size * angle)[size > 0].sum() / size.sum()
    return deviations


def signed_comac(one: Complex, other: Complex, weights: Real | None = None) -> Real:
    """Correlation of each degree of freedom over all modes, with its sign; (n,).

    Re sum_r a_r b_r^* / sqrt(sum |a_r|^2 sum |b_r|^2) of shapes scaled to one norm and phase each:
    -1 where a channel is turned round, which the COMAC, made of absolute values, does not see.

    Args:
        one: shapes in columns; (n, n_mode).
        other: their counterparts; likewise.
        weights: of the modes; (n_mode,), all alike if None.
    """
    size, other_size = np.linalg.norm(one, axis=0), np.linalg.norm(other, axis=0)
    product = (one.conj() * other).sum(axis=0)
    phase = np.where(product != 0, product / np.where(product != 0, np.abs(product), 1.0), 1.0)
    weight = np.ones(one.shape[1]) if weights is None else weights
    a = one * weight / np.where(size > 0, size, 1.0)
    b = other * weight / np.where(other_size > 0, other_size * phase, 1.0)
    sizes = np.sqrt((np.abs(a) ** 2).sum(axis=1) * (np.abs(b) ** 2).sum(axis=1))
    correlation: Real = (a.conj() * b).real.sum(axis=1) / np.where(sizes > 0, sizes, 1.0)
    return correlation


def paired(criterion: Real, least: float = 0.5) -> list[tuple[int, int]]:
    """Pairs of shapes, each once, with the largest sum of MAC; rows rising.

    Args:
        criterion: MAC; (n_one, n_other).
        least: MAC below which two shapes are no pair.
    """
    rows, columns = scipy.optimize.linear_sum_assignment(-np.where(criterion < least, 0, criterion))
    return [
        (int(row), int(column))
        for row, column in zip(rows, columns, strict=True)
        if criterion[row, column] >= least
    ]


def stability(
    orders: Sequence[Poles],
    *,
    frequency: float,
    damping: float,
    participation: float,
    highest_damping: float,
) -> tuple[Integers, ...]:
    """How each pole of each order compares with the order below, for a stabilisation diagram.

    Args:
        orders: poles of every order, rising.
        frequency: largest relative difference.
        damping: likewise.
        participation: least MAC of the participation.
        highest_damping: ratio above which a pole is no mode.

    Returns:
        For each order, for each pole: 0 negative or too much damping, 1 new, 2 with a like
        frequency below it, 3 with frequency and damping, 4 with participation too: stable.
    """
    found: list[Integers] = []
    for below, here in zip([None, *orders[:-1]], orders, strict=True):
        physical = (here.damping > 0) & (here.damping <= highest_damping)
        kind = np.where(physical, NEW, NOT_PHYSICAL).astype(np.intp)
        if below is not None and len(below.poles):
            ratio = np.maximum(np.abs(below.damping), 1e-300)
            alike = np.abs(here.freq_hz[:, None] / below.freq_hz - 1) <= frequency
            alike &= (below.damping > 0) & (below.damping <= highest_damping)
            damped = alike & (np.abs(here.damping[:, None] - below.damping) <= damping * ratio)
            same = damped & (mac(here.participation, below.participation) >= participation)
            for level, criterion in ((FREQUENCY, alike), (DAMPING, damped), (STABLE, same)):
                kind = np.where(physical & criterion.any(axis=1), level, kind)
        found.append(kind)
    return tuple(found)
