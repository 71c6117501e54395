"""Time response of the linear model, exact for inputs that are cubic between their samples."""

import numpy as np
import scipy.linalg
from scipy.interpolate import CubicSpline

from identification.words import Real, UsageError
from mbmodel.export.state_space import state_space
from mbmodel.frf.request import Question
from mbmodel.model import Model

_UNIFORM = 1e-6  # unevenness of the time axis, relative to its step


def respond(model: Model, theta: Real, question: Question, time_s: Real, signals: Real) -> Real:
    """Simulate from rest.

    Through the samples of each input goes a cubic spline u. Over one step x' = A x + B u is solved
    exactly, since (u, u', u'', u''') obeys a linear equation of its own: the exponential of

        [[A, B, 0, 0, 0], [0, 0, 1, 0, 0], [0, 0, 0, 1, 0], [0, 0, 0, 0, 1], [0, 0, 0, 0, 0]] dt

    carries both on (Van Loan 1978). So a step may be as long as the signals allow, whatever the
    machine's own frequencies.

    Args:
        model: machine and Parts.
        theta: parameters in SI; (n_parameter,).
        question: outputs and inputs; receptance gives displacements, mobility velocities,
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
    step = _step(time_s)
    if signals.shape != (len(time_s), len(question.inputs)):
        raise UsageError(
            f"signals have shape {signals.shape}, expected ({len(time_s)}, {len(question.inputs)}):"
            " a row a sample, a column an input"
        )
    system = state_space(model, theta, question)
    carried, driven = _over_one_step(system.A, system.B, step)
    spline = CubicSpline(time_s, signals)
    jets = np.hstack([spline(time_s, order) for order in range(4)])
    state = np.zeros(len(carried))
    states = np.empty((len(time_s), len(state)))
    pushes = jets @ driven.T
    for k in range(len(time_s)):
        states[k] = state
        state = carried @ state + pushes[k]
    outputs: Real = states @ system.C.T + signals @ system.D.T
    return outputs


def _step(time_s: Real) -> float:
    if time_s.ndim != 1 or len(time_s) < 4:
        raise UsageError(f"the time axis has shape {time_s.shape}: give at least 4 instants")
    steps = np.diff(time_s)
    step = float(steps.mean())
    if not (step > 0 and np.abs(steps - step).max() <= _UNIFORM * step):
        raise UsageError("the time axis is not evenly spaced and rising: resample the signals")
    return step


def _over_one_step(dynamics: Real, gain: Real, step: float) -> tuple[Real, Real]:
    """State after a step per state before it, and per (u, u', u'', u''') then.

    States are scaled to like sizes first: positions and velocities differ by the frequency.
    """
    size, inputs = gain.shape
    balanced, (scale, _) = scipy.linalg.matrix_balance(dynamics, permute=False, separate=True)
    whole = np.zeros((size + 4 * inputs, size + 4 * inputs))
    whole[:size, :size] = balanced
    whole[:size, size : size + inputs] = gain / scale[:, None]
    for order in range(3):
        start = size + order * inputs
        whole[start : start + inputs, start + inputs : start + 2 * inputs] = np.eye(inputs)
    # (u, u' dt, u'' dt^2, u''' dt^3) instead of the derivatives, for entries of like size
    units = np.concatenate([np.ones(size), *(np.full(inputs, step**k) for k in range(4))])
    power = scipy.linalg.expm(step * whole * units[:, None] / units)
    moved = power[:size] * units
    carried = moved[:, :size] * scale[:, None] / scale
    driven: Real = moved[:, size:] * scale[:, None]
    return carried, driven
