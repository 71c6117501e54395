"""A stable minimum-phase filter W(s) of given order with |W| above given magnitudes.

With s = i w and w = w0 tan(theta / 2), the squared magnitude of a rational filter is

    |W|^2 = P(cos theta) / Q(cos theta),   P and Q polynomials of the filter's order,

positive on [-1, 1], which is all frequencies from 0 to infinity. For a ratio t, e^2 <= P / Q <=
t^2 e^2 is linear in the coefficients: a linear program says whether some filter does it (the
problem is quasi-convex; Boyd and Vandenberghe 2004, ch. 4.2). Bisection finds the smallest t. The
roots of P and Q inside the unit circle of z, cos theta = (z + 1/z) / 2, give the zeros and poles in
the left half plane, s = w0 (z - 1) / (z + 1) (spectral factorisation, Fejer and Riesz).
"""

from dataclasses import dataclass

import numpy as np
import scipy.optimize
from numpy.polynomial import chebyshev

from identification.words import Complex, Real, UsageError

# Values of theta at which P and Q are kept positive, and at which that is checked.
_POSITIVE_POINTS, _CHECKED_POINTS = 1000, 20_001
_MIN_SHARE = 1e-5  # of the mean of Q, and of P in units of the magnitudes: no root on the axis
_SOLVER_TOLERANCE = 1e-9  # of the linear program: far below that share
_MAX_RATIO = 1e6  # of the filter to the magnitudes: beyond it there is nothing to fit
_RATIO_STEP = 0.01  # of the logarithm of the ratio, at which bisection ends
MAX_FILTER_ORDER = 20


@dataclass(frozen=True, eq=False)
class MinimumPhaseFilter:
    """W(s) = gain prod (s - zero) / prod (s - pole).

    Args:
        zeros: in the left half plane [rad/s]; (n,).
        poles: in the left half plane [rad/s]; (n,).
        gain: of the highest power.
        ratio: largest |W| over a magnitude that it bounds, at least 1.
    """

    zeros: Complex
    poles: Complex
    gain: float
    ratio: float

    def at(self, laplace: Complex) -> Complex:
        """Return W at each s [rad/s]; (n_freq,)."""
        numerator = np.prod(laplace[:, None] - self.zeros, axis=1)
        return self.gain * numerator / np.prod(laplace[:, None] - self.poles, axis=1)

    def polynomials(self) -> tuple[Real, Real]:
        """Return the coefficients of numerator and denominator, highest power first."""
        numerator, denominator = np.poly(self.zeros).real, np.poly(self.poles).real
        return np.asarray(self.gain * numerator, float), np.asarray(denominator, float)


def bound_magnitudes(freq_hz: Real, magnitudes: Real, order: int) -> MinimumPhaseFilter:
    """Return the stable minimum-phase filter nearest above magnitudes, in the logarithm.

    Args:
        freq_hz: lines above 0 Hz, rising [Hz]; (n_freq,).
        magnitudes: above zero; (n_freq,).
        order: of the filter, from 0.

    Raises:
        UsageError: an order that cannot be used.
    """
    if order not in range(MAX_FILTER_ORDER + 1):
        raise UsageError(f"a weight of order {order}: give 0 to {MAX_FILTER_ORDER}")
    middle = 2 * np.pi * float(np.sqrt(freq_hz[0] * freq_hz[-1]))
    cosines = np.cos(2 * np.arctan(2 * np.pi * freq_hz / middle))
    low, high = 0.0, float(np.log(magnitudes.max() / magnitudes.min())) + _RATIO_STEP
    best = _constant(magnitudes, order)
    high = min(high, float(np.log(_MAX_RATIO)))
    while high - low > _RATIO_STEP:
        middle_ratio = (low + high) / 2
        spectrum = _solve(cosines, magnitudes, float(np.exp(middle_ratio)), order)
        if spectrum is None:
            low = middle_ratio
        else:
            best, high = spectrum, middle_ratio
    return _factorise_spectrum(best, middle, freq_hz, magnitudes)


def _constant(magnitudes: Real, order: int) -> tuple[Real, Real]:
    """Return P and Q of the largest magnitude at all frequencies."""
    numerator, denominator = np.zeros(order + 1), np.zeros(order + 1)
    numerator[0], denominator[0] = magnitudes.max() ** 2, 1.0
    return numerator, denominator


def _solve(cosines: Real, magnitudes: Real, ratio: float, order: int) -> tuple[Real, Real] | None:
    """Return Chebyshev coefficients of P and Q within a ratio of the magnitudes, or None."""
    size = float(np.exp(np.log(magnitudes).mean()))
    power = (magnitudes / size) ** 2
    basis = chebyshev.chebvander(cosines, order)
    grid = chebyshev.chebvander(np.cos(np.linspace(0, np.pi, _POSITIVE_POINTS)), order)
    weight = 1 / np.sqrt(power)[:, None]
    nothing = np.zeros_like(grid)
    rows = np.vstack(
        [
            np.hstack([-basis * weight, basis * weight * power[:, None]]),
            np.hstack([basis * weight / ratio, -basis * weight * power[:, None] * ratio]),
            np.hstack([-grid, nothing]),
            np.hstack([nothing, -grid]),
        ]
    )
    limits = np.concatenate([np.zeros(2 * len(power)), np.full(2 * len(grid), -_MIN_SHARE)])
    total = np.zeros((1, rows.shape[1]))
    total[0, order + 1] = 1.0  # the mean of Q over theta
    result = scipy.optimize.linprog(
        np.zeros(rows.shape[1]),
        rows,
        limits,
        total,
        [1.0],
        bounds=(None, None),
        method="highs",
        options={"primal_feasibility_tolerance": _SOLVER_TOLERANCE},
    )
    if result.status != 0:
        return None
    numerator, denominator = result.x[: order + 1], result.x[order + 1 :]
    return _raise_above_zero(numerator) * size**2, _raise_above_zero(denominator)


def _raise_above_zero(coefficients: Real) -> Real:
    """Return a polynomial that is positive between the points of the linear program too."""
    values = chebyshev.chebval(np.cos(np.linspace(0, np.pi, _CHECKED_POINTS)), coefficients)
    raised: Real = coefficients.copy()
    raised[0] += max(0.0, _MIN_SHARE / 2 - float(values.min()))
    return raised


def _factorise_spectrum(
    spectrum: tuple[Real, Real], middle: float, freq_hz: Real, magnitudes: Real
) -> MinimumPhaseFilter:
    """Return the minimum-phase factor of P / Q, raised to lie above all magnitudes."""
    zeros, poles = (_stable_roots(coefficients, middle) for coefficients in spectrum)
    unit = MinimumPhaseFilter(zeros, poles, 1.0, 1.0)
    shape = np.abs(unit.at(np.asarray(2j * np.pi * freq_hz, complex)))
    gain = float((magnitudes / shape).max()) * (1 + 1e-9)
    return MinimumPhaseFilter(zeros, poles, gain, float((gain * shape / magnitudes).max()))


def _stable_roots(coefficients: Real, middle: float) -> Complex:
    """Return the roots in the left half plane of s; (order,).

    A root at z = -1 is one at infinity: the polynomial is of lower degree there and has none.
    """
    degrees = np.flatnonzero(np.abs(coefficients) > _NEGLIGIBLE * np.abs(coefficients).max())
    cosines = chebyshev.chebroots(coefficients[: int(degrees.max(initial=0)) + 1])
    roots = np.asarray(cosines, complex)
    circle = roots + np.sqrt(roots - 1) * np.sqrt(roots + 1)
    inside = np.where(np.abs(circle) > 1, 1 / circle, circle)
    missing = np.zeros(len(coefficients) - 1 - len(inside), complex)
    z = np.concatenate([inside, missing])  # a missing degree of cos theta is a root at z = 0
    return np.asarray(middle * (z - 1) / (z + 1), complex)


_NEGLIGIBLE = 1e-13  # of the largest Chebyshev coefficient: a degree that is not there
