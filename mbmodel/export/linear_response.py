"""Time response of the linear model, exact for inputs that are cubic between their samples."""

from dataclasses import replace

import numpy as np
import scipy.linalg
from scipy.interpolate import CubicSpline

from identification.words import Real, UsageError
from mbmodel.export.state_space import state_space
from mbmodel.model import Model
from mbmodel.ports.request import FrfRequest

# Band in which laws such as losses and delays are approximated: a cubic spline follows signals up
# to a tenth of the sampling rate.
_BAND_SHARE = 0.1
_LAW_LINES = 400
_MAX_STEP_UNEVENNESS = 1e-6  # relative to the step: rounding of a time axis in a file


def respond_linearly(
    model: Model, theta: Real, request: FrfRequest, time_s: Real, signals: Real
) -> Real:
    """Compute the time response of the linear model from rest.

    A cubic spline u interpolates the samples of each input. Over one step x' = A x + B u is solved
    exactly, since (u, u', u'', u''') obeys a linear equation of its own. The matrix exponential of

        [[A, B, 0, 0, 0], [0, 0, 1, 0, 0], [0, 0, 0, 1, 0], [0, 0, 0, 0, 1], [0, 0, 0, 0, 0]] dt

    advances both (Van Loan 1978). So the step is limited by the signals, not by the machine's
    natural frequencies. Losses and delays are approximated in the band that the samples resolve.

    Args:
        theta: parameters in SI; (n_parameter,).
        request: outputs and inputs; receptance gives displacements, mobility velocities,
            accelerance accelerations. Its frequencies do not matter.
        time_s: evenly spaced [s]; (n_time,), at least 4.
        signals: of the inputs [N, N m, m/s^2 of the floor, control of a motor];
            (n_time, n_in).

    Returns:
        Outputs [m, m/s or m/s^2; rad for rotations]; (n_time, n_out).

    Raises:
        UsageError: an uneven time axis, or shapes that do not fit.
    """
    time_s, signals = np.asarray(time_s, float), np.asarray(signals, float)
    step = even_step(time_s)
    if signals.shape != (len(time_s), len(request.inputs)):
        raise UsageError(
            f"signals have shape {signals.shape}, expected ({len(time_s)}, {len(request.inputs)}):"
            " one row per sample, one column per input"
        )
    highest = _BAND_SHARE / step
    lines = np.linspace(highest / _LAW_LINES, highest, _LAW_LINES)
    system = state_space(model, theta, replace(request, freq_hz=lines))
    transition, input_matrix = _discretise(system.A, system.B, step)
    spline = CubicSpline(time_s, signals)
    input_derivatives = np.hstack([spline(time_s, order) for order in range(4)])
    state = np.zeros(len(transition))
    states = np.empty((len(time_s), len(state)))
    increments = input_derivatives @ input_matrix.T
    for k in range(len(time_s)):
        states[k] = state
        state = transition @ state + increments[k]
    return states @ system.C.T + signals @ system.D.T


def even_step(time_s: Real) -> float:
    """Return the step of an evenly spaced time axis [s].

    Args:
        time_s: instants [s]; (n_time,).

    Raises:
        UsageError: fewer than 4 instants, or uneven ones.
    """
    if time_s.ndim != 1 or len(time_s) < 4:
        raise UsageError(f"the time axis has shape {time_s.shape}: give at least 4 instants")
    steps = np.diff(time_s)
    step = float(steps.mean())
    if not (step > 0 and np.abs(steps - step).max() <= _MAX_STEP_UNEVENNESS * step):
        raise UsageError("the time axis is not evenly spaced and rising: resample the signals")
    return step


def _discretise(dynamics: Real, gain: Real, step: float) -> tuple[Real, Real]:
    """Return the state after a step per state before it, and per (u, u', u'', u''') before it.

    States are scaled to similar sizes first: positions and velocities differ by the frequency.

    Args:
        gain: B; (n, n_in).
        step: dt [s].
    """
    size, inputs = gain.shape
    balanced, (scale, _) = scipy.linalg.matrix_balance(dynamics, permute=False, separate=True)
    extended = np.zeros((size + 4 * inputs, size + 4 * inputs))
    extended[:size, :size] = balanced
    extended[:size, size : size + inputs] = gain / scale[:, None]
    for order in range(3):
        start = size + order * inputs
        extended[start : start + inputs, start + inputs : start + 2 * inputs] = np.eye(inputs)
    # (u, u' dt, u'' dt^2, u''' dt^3) instead of the derivatives, for entries of like size
    units = np.concatenate([np.ones(size), *(np.full(inputs, step**k) for k in range(4))])
    power = scipy.linalg.expm(step * extended * units[:, None] / units)
    scaled = power[:size] * units
    transition = scaled[:, :size] * scale[:, None] / scale
    input_matrix: Real = scaled[:, size:] * scale[:, None]
    return transition, input_matrix
