"""Rational functions in place of laws that are no polynomials in s, with their errors in a band.

A Maxwell branch is rational: one state holds it exactly. A delay is approximated by Pade's
fraction (Baker and Graves-Morris 1996, ch. 1), which is stable and of magnitude one, as the delay
is.

A loss that is constant at all frequencies is not causal: by the relations of Kramers and Kronig
k (1 + i eta) needs a stiffness that rises by (2 / pi) eta k ln(w) (Crandall 1970). So what is
fitted is a sum of Maxwell branches beside a spring and a damper,

    i sign(w)  ~  constant + slope s + sum a_j s / (s + w_j),   a_j, slope >= 0

with corner frequencies w_j at even steps of their logarithm: stable and passive, in least squares.
A line counts by how much the spring is strained there, since its error shows in FRFs so much. The
error has a floor that grows with the band, whatever the order. Any other law is fitted by
stable poles (``vector_fitting``) that do not grow outside the band, or by such branches.

The controller of a control loop is rational: its states hold it exactly, beside the fraction of its
delay. A sampled one is the continuous one of Tustin's rule, with the delay of its hold.

A law as a sum of Maxwell branches, each a spring and a damper in series, beside a spring.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.optimize

from identification.words import Complex, Integers, Real
from mbmodel.control_loops.loop_law import DelayFraction, LoopFraction, LoopLaw
from mbmodel.export.rational_function import HasStates, RationalFunction
from mbmodel.export.vector_fitting import fit_poles_and_residues
from mbmodel.parts.spring_laws import ConstantLoss, LateForce, Relaxation

# Error of a law, relative to its largest magnitude in the band, at which the order is enough: FRFs
# of a hammer test have a noise above 1e-4.
_MAX_LAW_ERROR = 1e-6
_MAX_PADE_ORDER = 80  # of a delay: some ten turns at the end of the band
_MAX_FITTED_ORDER = 24  # of any other law
_MAX_BRANCHES = 24  # of a constant loss: six a decade over four decades
# Share by which the error of a constant loss may exceed the floor that no order goes below.
_FLOOR_MARGIN = 0.02
# Range beyond both ends of the band in which a fit may be so many times larger than the law.
_OUTER_RANGE, _OUTER_LINES, _MAX_GROWTH = 100.0, 400, 5.0
_MAX_FITTED_LINES = 400  # lines of a fit; more change nothing


@dataclass(frozen=True, eq=False)
class Approximation:
    """A rational function in place of a law f(s).

    Args:
        kind: ``exact``, ``pade``, ``tustin``, ``maxwell branches`` or ``fitted poles``.
        function: r(s).
        max_error: largest |r - f| in the band over the largest |f| there.
        rms_error: root mean square of it over the lines.
        weighted_error: likewise, each line weighted by how much the spring is strained there.
        largest_size: that largest |f|.
        band_hz: lowest and highest line [Hz].
        is_passive: whether it dissipates at every frequency, as the law does; None if the law
            itself need not.
    """

    kind: str
    function: HasStates
    max_error: float
    rms_error: float
    weighted_error: float
    largest_size: float
    band_hz: tuple[float, float]
    is_passive: bool | None


def approximate(
    shape: Callable[[Complex], Complex],
    freq_hz: Real,
    *,
    has_slope: bool,
    weights: Real | None = None,
    lowest_constant: float = -np.inf,
) -> Approximation:
    """Return a stable rational function for a law, of the smallest order that is good enough.

    Args:
        shape: f(s).
        freq_hz: frequency lines above 0 Hz [Hz]; (n_freq,).
        has_slope: whether a term proportional to s can be held.
        weights: of the lines, such as the strain of the spring; equal if None; (n_freq,).
        lowest_constant: f(0) of Maxwell branches is at least this, so that the spring that they
            belong to keeps a static stiffness.
    """
    weights = np.ones(len(freq_hz)) if weights is None else weights
    step = max(1, len(freq_hz) // _MAX_FITTED_LINES)
    lines = np.append(np.arange(0, len(freq_hz) - 1, step), len(freq_hz) - 1)
    laplace = np.asarray(2j * np.pi * freq_hz[lines], complex)
    if isinstance(shape, Relaxation):
        rate = 1.0 / shape.time_s
        function = RationalFunction(np.array([-rate + 0j]), np.array([-rate + 0j]), 1.0)
        return _measure("exact", function, shape, freq_hz, is_passive=True)
    if isinstance(shape, LateForce):
        delay_s = shape.delay_s
        return _smallest_order(
            lambda order: _measure("pade", DelayFraction(delay_s, order), shape, freq_hz),
            _MAX_PADE_ORDER,
        )
    if isinstance(shape, LoopLaw):
        return _controller_states(shape, freq_hz)
    if isinstance(shape, ConstantLoss):
        return _fewest_branches(shape, lines, freq_hz, weights, lowest_constant)
    values = shape(laplace)
    fit = _smallest_order(
        lambda order: _refuse_growth(
            _measure(
                "fitted poles",
                fit_poles_and_residues(laplace, values, order, has_slope=has_slope),
                shape,
                freq_hz,
            ),
            shape,
            laplace,
        ),
        _MAX_FITTED_ORDER,
    )
    if fit.max_error <= _MAX_LAW_ERROR or not has_slope:
        return fit
    branches = _fewest_branches(shape, lines, freq_hz, weights, lowest_constant)
    return min(fit, branches, key=lambda each: (np.isinf(each.max_error), each.rms_error))


def _measure(
    kind: str,
    function: HasStates,
    shape: Callable[[Complex], Complex],
    freq_hz: Real,
    *,
    is_passive: bool | None = None,
    weights: Real | None = None,
) -> Approximation:
    """Return an approximation with its errors at all lines."""
    laplace = np.asarray(2j * np.pi * freq_hz, complex)
    values = shape(laplace)
    largest = float(np.abs(values).max())
    error = np.abs(function.at(laplace) - values) / max(largest, 1e-300)
    band = float(freq_hz[0]), float(freq_hz[-1])
    rms = float(np.sqrt((error**2).mean()))
    weighted = float(np.sqrt(np.average(error**2, weights=None if weights is None else weights**2)))
    return Approximation(
        kind, function, float(error.max()), rms, weighted, largest, band, is_passive
    )


def _controller_states(law: LoopLaw, freq_hz: Real) -> Approximation:
    """Return the states of a control loop, with Pade's fraction of its delay if it has one.

    The order is that of the delay alone, since K may be far larger at some lines than at others.
    """
    delay_s = law.states_delay_s
    if not delay_s:
        return _measure("exact", LoopFraction(law, 0), law, freq_hz)
    delay = _smallest_order(
        lambda order: _measure("pade", DelayFraction(delay_s, order), LateForce(delay_s), freq_hz),
        _MAX_PADE_ORDER,
    )
    kind = "tustin" if law.controller.period_s else "pade"
    return _measure(kind, LoopFraction(law, delay.function.order), law, freq_hz)


def _smallest_order(build: Callable[[int], Approximation], largest: int) -> Approximation:
    """Return the approximation of the smallest order within the allowed error, else the best."""
    best = build(1)
    for order in range(2, largest + 1):
        if best.max_error <= _MAX_LAW_ERROR:
            break
        candidate = build(order)
        if candidate.max_error < best.max_error:
            best = candidate
    return best


def _refuse_growth(
    fit: Approximation, shape: Callable[[Complex], Complex], laplace: Complex
) -> Approximation:
    """Return a fit, with an infinite error if it is much larger than the law outside the band.

    A fit may buy accuracy in the band by huge values outside, which would move or destabilise modes
    there.
    """
    beyond = laplace[0].imag / _OUTER_RANGE, laplace[-1].imag * _OUTER_RANGE
    outside = np.asarray(1j * np.geomspace(*beyond, _OUTER_LINES), complex)
    size = float(np.abs(fit.function.at(outside)).max())
    if size > _MAX_GROWTH * float(np.abs(shape(outside)).max()):
        return replace(fit, max_error=np.inf)
    return fit


def _fewest_branches(
    shape: Callable[[Complex], Complex],
    lines: Integers,
    freq_hz: Real,
    weights: Real,
    lowest_constant: float,
) -> Approximation:
    """Return the fewest Maxwell branches whose weighted error is near the floor.

    Args:
        lines: numbers of the lines that are fitted; (n_fitted,).
        freq_hz: all lines [Hz]; (n_freq,).
        weights: of all lines; (n_freq,).
        lowest_constant: lower bound of f(0).
    """
    laplace = np.asarray(2j * np.pi * freq_hz[lines], complex)
    values = shape(laplace)
    fits = [
        _measure(
            "maxwell branches",
            fit_maxwell_branches(laplace, values, weights[lines], branches, lowest_constant),
            shape,
            freq_hz,
            is_passive=True,
            weights=weights,
        )
        for branches in range(1, _MAX_BRANCHES + 1)
    ]
    floor = min(fit.weighted_error for fit in fits)
    return next(fit for fit in fits if fit.weighted_error <= (1 + _FLOOR_MARGIN) * floor)


_OUTER_CORNERS = 4.0  # corner frequencies reach beyond the band by this factor


def fit_maxwell_branches(
    laplace: Complex, values: Complex, weights: Real, branches: int, lowest_constant: float
) -> RationalFunction:
    """Fit a law by a spring, and Maxwell branches and a damper of positive size.

    The spring may be negative, down to a bound. Non-negative least squares (Lawson and Hanson
    1974): without a bound it is the difference of two springs, with one it counts from there.

    Args:
        laplace: s = i w, rising [rad/s]; (n_freq,).
        values: of the law; (n_freq,).
        weights: of the lines; (n_freq,).
        branches: number of corner frequencies, at even steps of their logarithm.
        lowest_constant: lower bound of the law at s = 0; -inf for none.
    """
    omega = laplace.imag
    corners = np.geomspace(omega[0] / _OUTER_CORNERS, omega[-1] * _OUTER_CORNERS, branches)
    is_bounded = np.isfinite(lowest_constant)
    start = lowest_constant if is_bounded else 0.0
    columns = np.stack(
        [
            np.ones_like(laplace),
            np.zeros_like(laplace) if is_bounded else -np.ones_like(laplace),
            laplace / omega[-1],
            *(laplace / (laplace + corner) for corner in corners),
        ],
        axis=1,
    )
    target = np.concatenate([values.real - start, values.imag])
    rows = np.tile(weights / weights.max(), 2)
    matrix = np.vstack([columns.real, columns.imag])
    sizes, _ = scipy.optimize.nnls(rows[:, None] * matrix, rows * target)
    used = sizes[3:] > 0
    sum_of_branches = float(sizes[3:].sum())
    return RationalFunction(
        -corners[used] + 0j,
        -(sizes[3:] * corners)[used] + 0j,
        start + float(sizes[0] - sizes[1]) + sum_of_branches,
        float(sizes[2] / omega[-1]),
    )
