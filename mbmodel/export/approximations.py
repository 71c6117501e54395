"""Rational functions in place of laws that are no polynomials in s, with their errors in a band.

A Maxwell branch is rational: one state holds it exactly. A delay is approximated by Pade's
fraction (Baker and Graves-Morris 1996, ch. 1), which is stable and of magnitude one, as the delay
is.

Any other law is fitted by stable poles (``vector_fitting``) that do not grow outside the band.
Where these do not suffice, a loss i h that is constant at all positive frequencies stands beside
them; it has no such function, and the whole system holds it (``positive_frequencies``).

The controller of a control loop is rational: its states hold it exactly, beside the fraction of its
delay. A sampled one is the continuous one of Tustin's rule, with the delay of its hold.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from identification.words import Complex, InputError, Real
from mbmodel.control_loops.loop_law import DelayFraction, LoopFraction, LoopLaw
from mbmodel.export.rational_function import HasStates, RationalFunction
from mbmodel.export.vector_fitting import fit_poles_and_residues
from mbmodel.parts.spring_laws import ConstantLoss, LateForce, Relaxation

# Error of a law, relative to its largest magnitude in the band, at which the order is enough: FRFs
# of a hammer test have a noise above 1e-4.
_MAX_LAW_ERROR = 1e-6
_MAX_PADE_ORDER = 80  # of a delay: some ten turns at the end of the band
_MAX_FITTED_ORDER = 24  # of any other law
# Range beyond both ends of the band in which a fit may be so many times larger than the law.
_OUTER_RANGE, _OUTER_LINES, _MAX_GROWTH = 100.0, 400, 5.0
_MAX_FITTED_LINES = 400  # lines of a fit; more change nothing
_NO_FUNCTION = RationalFunction(np.zeros(0, complex), np.zeros(0, complex))


@dataclass(frozen=True, eq=False)
class Approximation:
    """A rational function in place of a law f(s).

    Args:
        kind: ``exact``, ``pade``, ``tustin``, ``fitted poles``, or ``positive frequencies`` of a
            constant loss.
        function: r(s).
        loss: h of a constant loss i h beside it, at positive frequencies.
        max_error: largest |r + i h - f| in the band over the largest |f| there. With a loss, in
            ``StateSpaceExport``: largest difference of the accelerance along the spring over its
            peak.
        rms_error: root mean square of it over the lines.
        largest_size: that largest |f|.
        band_hz: lowest and highest line [Hz].
        is_passive: whether it dissipates at every frequency, as the law does; None if the law
            itself need not.
    """

    kind: str
    function: HasStates
    loss: float
    max_error: float
    rms_error: float
    largest_size: float
    band_hz: tuple[float, float]
    is_passive: bool | None


def approximate(
    shape: Callable[[Complex], Complex],
    freq_hz: Real,
    *,
    has_slope: bool,
    has_loss: bool = True,
) -> Approximation:
    """Return a stable rational function for a law, of the smallest order that is good enough.

    Args:
        shape: f(s).
        freq_hz: frequency lines above 0 Hz [Hz]; (n_freq,).
        has_slope: whether a term proportional to s can be held.
        has_loss: whether a constant loss can.

    Raises:
        InputError: every stable fit is far larger than the law outside the band.
    """
    if isinstance(shape, ConstantLoss) and has_loss:
        return _measure("positive frequencies", _NO_FUNCTION, shape, freq_hz, loss=1.0)
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
    fit = _fit_poles(shape, freq_hz, has_slope=has_slope, has_loss=False)
    if fit.max_error > _MAX_LAW_ERROR and has_loss:
        lossy = _fit_poles(shape, freq_hz, has_slope=has_slope, has_loss=True)
        fit = min(fit, lossy, key=lambda each: each.max_error)
    if np.isinf(fit.max_error):
        raise InputError(
            f"no stable system has a law like {shape} from {freq_hz[0]:g} to {freq_hz[-1]:g} Hz "
            "without growing outside: request FRFs, or a narrower band"
        )
    return fit


def _fit_poles(
    shape: Callable[[Complex], Complex], freq_hz: Real, *, has_slope: bool, has_loss: bool
) -> Approximation:
    """Return the fit of fewest stable poles within the allowed error, else the best."""
    step = max(1, len(freq_hz) // _MAX_FITTED_LINES)
    lines = np.append(np.arange(0, len(freq_hz) - 1, step), len(freq_hz) - 1)
    laplace = np.asarray(2j * np.pi * freq_hz[lines], complex)
    values, kind = shape(laplace), "positive frequencies" if has_loss else "fitted poles"

    def fit(order: int) -> Approximation:
        function, loss = fit_poles_and_residues(
            laplace, values, order, has_slope=has_slope, has_loss=has_loss
        )
        measured = _measure(kind, function, shape, freq_hz, loss=loss)
        return _refuse_growth(measured, shape, laplace)

    return _smallest_order(fit, _MAX_FITTED_ORDER)


def _measure(
    kind: str,
    function: HasStates,
    shape: Callable[[Complex], Complex],
    freq_hz: Real,
    *,
    loss: float = 0.0,
    is_passive: bool | None = None,
) -> Approximation:
    """Return an approximation with its errors at all lines."""
    laplace = np.asarray(2j * np.pi * freq_hz, complex)
    values = shape(laplace)
    largest = float(np.abs(values).max())
    error = np.abs(function.at(laplace) + 1j * loss - values) / max(largest, 1e-300)
    band = float(freq_hz[0]), float(freq_hz[-1])
    rms = float(np.sqrt((error**2).mean()))
    worst = float(error.max())
    return Approximation(kind, function, loss, worst, rms, largest, band, is_passive)


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
    size = float(np.abs(fit.function.at(outside) + 1j * fit.loss).max())
    if size > _MAX_GROWTH * float(np.abs(shape(outside)).max()):
        return replace(fit, max_error=np.inf)
    return fit
