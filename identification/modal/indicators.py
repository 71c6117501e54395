"""Mode indicator functions, and criteria of how well shapes correlate and how real they are."""

from collections.abc import Sequence

import numpy as np
import scipy.optimize

from identification.modal.lscf_method import Poles
from identification.words import Complex, Integers, Real

# Levels of a pole in a stabilisation diagram, compared with the poles of the order below.
NOT_PHYSICAL, NEW, FREQUENCY, DAMPING, STABLE = range(5)


def cmif(values: Complex) -> Real:
    """Compute the complex mode indicator function: squared singular values of H.

    The method is that of Shih et al. (1988); seed, eq. 3.1 and 3.2.

    Args:
        values: FRFs; (n_freq, n_out, n_in).

    Returns:
        Largest first; (n_freq, n_in), or n_out if that is less.
    """
    return np.asarray(np.linalg.svd(values, compute_uv=False) ** 2, np.float64)


def mmif(values: Complex) -> Real:
    """Compute the multivariate mode indicator function of accelerances or receptances.

    The force patterns f make the motion as much out of phase as possible: min f' Re H' Re H f / f'
    (Re H' Re H + Im H' Im H) f. The minimum is zero at an undamped resonance of real modes
    (Williams, Crowley and Vold 1985).

    Args:
        values: FRFs whose resonances are imaginary; (n_freq, n_out, n_in).

    Returns:
        Smallest first, 0 .. 1; (n_freq, n_in).
    """
    grams = [np.swapaxes(part, 1, 2) @ part for part in (values.real, values.imag)]
    real, total = grams[0], grams[0] + grams[1]
    size = np.trace(total, axis1=1, axis2=2)[:, None, None]
    is_silent = size == 0  # a line without motion shows no mode: its indicator is 1
    total = np.where(
        is_silent, np.eye(total.shape[1]), total + 1e-12 * size * np.eye(total.shape[1])
    )
    whitening = np.linalg.inv(np.linalg.cholesky(total))
    return np.linalg.eigvalsh(
        whitening @ np.where(is_silent, total, real) @ np.swapaxes(whitening, 1, 2)
    )


def mac(first: Complex, second: Complex) -> Real:
    """Compute the modal assurance criterion |a^H b|^2 / (a^H a b^H b) of every pair of shapes.

    The criterion is that of Allemang and Brown (1982).

    Args:
        first: shapes in columns; (n, n_first).
        second: shapes in columns; (n, n_second).

    Returns:
        0 .. 1, zero for a shape of zeros; (n_first, n_second).
    """
    product = np.abs(first.conj().T @ second) ** 2
    sizes = np.outer((np.abs(first) ** 2).sum(axis=0), (np.abs(second) ** 2).sum(axis=0))
    return product / np.where(sizes > 0, sizes, 1.0)


def auto_mac(shapes: Complex) -> Real:
    """Compute the MAC of every shape with every shape of one set; (n_mode, n_mode)."""
    return mac(shapes, shapes)


def frac(first: Complex, second: Complex) -> Real:
    """Compute the frequency response assurance criterion |a^H b|^2 / (a^H a b^H b) of each FRF.

    It is the MAC over frequency lines (Heylen and Lammens 1996), zero where either FRF vanishes.

    Args:
        first: FRFs; (n_freq, ...).
        second: FRFs; (n_freq, ...).

    Returns:
        0 .. 1; without the first axis.
    """
    product = np.abs((first.conj() * second).sum(axis=0))
    sizes = [np.linalg.norm(values, axis=0) for values in (first, second)]
    first_norm, second_norm = (np.where(size > 0, size, 1.0) for size in sizes)
    return (product / first_norm / second_norm) ** 2


def comac(first: Complex, second: Complex) -> Real:
    """Compute the coordinate MAC of paired shapes: agreement of each degree of freedom.

    (sum_r |a_r b_r|)^2 / (sum |a_r|^2 sum |b_r|^2), sums over all modes (Lieven and Ewins 1988).

    Args:
        first: shapes in columns; (n, n_mode).
        second: their counterparts in columns; (n, n_mode).

    Returns:
        0 .. 1; (n,).
    """
    product = (np.abs(first * second)).sum(axis=1) ** 2
    sizes = (np.abs(first) ** 2).sum(axis=1) * (np.abs(second) ** 2).sum(axis=1)
    return product / np.where(sizes > 0, sizes, 1.0)


def mpc(shapes: Complex) -> Real:
    """Compute the modal phase collinearity: 1 for a shape that is real but for a phase; (n_mode,).

    With S the covariance of real and imaginary parts, the criterion is the squared ratio of
    difference and sum of its eigenvalues (Pappa, Elliott and Schenk 1993).
    """
    xx = (shapes.real**2).sum(axis=0)
    yy = (shapes.imag**2).sum(axis=0)
    xy = (shapes.real * shapes.imag).sum(axis=0)
    total = xx + yy
    return ((xx - yy) ** 2 + 4 * xy**2) / np.where(total > 0, total, 1.0) ** 2


def mpd(shapes: Complex) -> Real:
    """Compute the mean phase deviation from the line through the points of a shape [rad].

    Each degree of freedom is weighted by its amplitude.

    Args:
        shapes: shapes in columns; (n, n_mode).

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


def signed_comac(first: Complex, second: Complex, weights: Real | None = None) -> Real:
    """Compute the signed correlation of each degree of freedom over all modes; (n,).

    Re sum_r a_r b_r^* / sqrt(sum |a_r|^2 sum |b_r|^2) of shapes that are scaled to one norm and
    phase each. A channel with inverted polarity gives -1. The COMAC is made of absolute values and
    cannot show it.

    Args:
        first (n, n_mode), second (n, n_mode): as for ``comac``.
        weights: weights of the modes; (n_mode,), equal if None.
    """
    first_norm, second_norm = np.linalg.norm(first, axis=0), np.linalg.norm(second, axis=0)
    product = (first.conj() * second).sum(axis=0)
    phase = np.where(product != 0, product / np.where(product != 0, np.abs(product), 1.0), 1.0)
    weight = np.ones(first.shape[1]) if weights is None else weights
    a = first * weight / np.where(first_norm > 0, first_norm, 1.0)
    b = second * weight / np.where(second_norm > 0, second_norm * phase, 1.0)
    sizes = np.sqrt((np.abs(a) ** 2).sum(axis=1) * (np.abs(b) ** 2).sum(axis=1))
    return (a.conj() * b).real.sum(axis=1) / np.where(sizes > 0, sizes, 1.0)


def pair_shapes(criterion: Real, min_mac: float = 0.5) -> list[tuple[int, int]]:
    """Pair shapes one to one such that the sum of their MAC is largest.

    The assignment is solved by the Hungarian method (Kuhn 1955).

    Args:
        criterion: MAC; (n_first, n_second).
        min_mac: MAC below which two shapes are no pair.

    Returns:
        Pairs of row and column, rows rising.
    """
    rows, columns = scipy.optimize.linear_sum_assignment(
        -np.where(criterion < min_mac, 0, criterion)
    )
    return [
        (int(row), int(column))
        for row, column in zip(rows, columns, strict=True)
        if criterion[row, column] >= min_mac
    ]


def classify_pole_stability(
    orders: Sequence[Poles],
    *,
    frequency: float,
    damping: float,
    participation: float,
    highest_damping: float,
) -> tuple[Integers, ...]:
    """Compare the poles of each order with the order below, for a stabilisation diagram.

    Args:
        orders: poles of every order, rising.
        frequency: largest relative difference of frequency.
        damping: largest relative difference of damping.
        participation: smallest MAC of the participation.
        highest_damping: damping ratio above which a pole is not physical.

    Returns:
        A level for each pole of each order. 0: damping negative or too high; 1: new; 2: frequency
            agrees with the order below; 3: damping agrees too; 4: participation agrees too, so the
            pole is stable.
    """
    levels: list[Integers] = []
    for below, here in zip([None, *orders[:-1]], orders, strict=True):
        physical = (here.damping > 0) & (here.damping <= highest_damping)
        level = np.where(physical, NEW, NOT_PHYSICAL).astype(np.intp)
        if below is not None and len(below.poles):
            ratio = np.maximum(np.abs(below.damping), 1e-300)
            same_frequency = np.abs(here.freq_hz[:, None] / below.freq_hz - 1) <= frequency
            same_frequency &= (below.damping > 0) & (below.damping <= highest_damping)
            same_damping = same_frequency & (
                np.abs(here.damping[:, None] - below.damping) <= damping * ratio
            )
            same_participation = same_damping & (
                mac(here.participation, below.participation) >= participation
            )
            for criterion_level, matches in (
                (FREQUENCY, same_frequency),
                (DAMPING, same_damping),
                (STABLE, same_participation),
            ):
                level = np.where(physical & matches.any(axis=1), criterion_level, level)
        levels.append(level)
    return tuple(levels)
