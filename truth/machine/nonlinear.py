r"""Nonlinear joints in the time domain, by an integrator of its own.

A joint's force is its linear part, which is in the equations, and a rest g(x) that vanishes with
the motion. So the motion is that of the linear machine under the hit and under -g:

    X(w) = H(w) F(w) - H_g(w) G(w)

with the exact linear H and H_g, and at vanishing level X is the linear machine's to the last digit.
Only G needs time: the linear machine is propagated exactly, mode by mode, under half sines of the
hammer and under a force of the joint that is straight between two samples h apart,

    z_{n+1} = e^{lambda h} z_n - gamma_0 b g_n - gamma_1 b g_{n+1},
    gamma_1 = (e^{lambda h} - 1 - lambda h) / (lambda^2 h),
    gamma_0 = (e^{lambda h} - 1) / lambda - gamma_1,

and g_{n+1}, which depends on the stretch that it makes, is found by repetition. The transform of
the broken line through the samples of g is exact too, and a rest that stays (a slipped friction
joint) is held for ever: i w G is the transform of its steps.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from truth.errors import TruthError
from truth.machine.rig import NonlinearJoint, Rig, null_basis, read_accelerations, receptance
from truth.machine.station import Complex, Real

RATE_HZ = 8192.0
_MAX_REPETITIONS = 40  # repetitions for the implicit force, at most
_SETTLED = 1e-10  # of the largest force of the sample, or of what ever was
_LOOK = 2.0  # periods of the slowest mode between two looks whether joints are still at work:
# one that is at its limit is quiet too, for less than half a period
_QUIET = 1e-7  # of the largest step of the force: below it they are not


@dataclass(frozen=True, eq=False)
class HalfSinePulses:
    """Half sines: peaks [N] and durations [s]; (n_hit,) each."""

    peak: Real
    duration: Real

    def at(self, seconds: float) -> Real:
        """Forces at a time [N]; (n_hit,)."""
        inside = (seconds >= 0) & (seconds <= self.duration)
        return np.where(inside, self.peak * np.sin(np.pi * seconds / self.duration), 0.0)

    def answer(self, roots: Complex, seconds: float) -> Complex:
        """What z' = lambda z + f has become at a time, from rest; (n_root, n_hit).

        With p = pi / T: (p e^{lambda t} - lambda sin p t - p cos p t) / (lambda^2 + p^2) while the
        pulse of duration T lasts, then what it was at its end times e^{lambda (t - T)}.
        """
        turn, root = np.pi / self.duration, roots[:, None]
        time = np.minimum(seconds, self.duration)
        grown = turn * np.exp(root * time) - root * np.sin(turn * time) - turn * np.cos(turn * time)
        after: Complex = np.exp(root * (seconds - time)) * grown / (root**2 + turn**2)
        return self.peak * after


def nonlinear_readings(
    rig: Rig,
    columns: tuple[int, ...],
    pulses: HalfSinePulses,
    freq_hz: Real,
    rate_hz: float = RATE_HZ,
) -> Complex:
    """Return what the nonlinear rest adds to the spectra of the readings.

    Args:
        rig: with its nonlinear joints.
        columns: the hammer of each hit.
        pulses: the hits; (n_hit,).
        freq_hz: evenly spaced lines from 0 [Hz]; (n_freq,).
        rate_hz: samples per second.

    Returns:
        (n_hit, n_freq, n_out) [m/s2 s]; zero at 0 Hz.

    Raises:
        TruthError: the machine also has a stiffness that depends on frequency.
    """
    steps = rest_forces(rig, columns, pulses, 1 / (freq_hz[1] - freq_hz[0]), rate_hz)
    reading = np.zeros((len(pulses.peak), freq_hz.size, len(rig.readout)), np.complex128)
    lines = freq_hz[1:]
    rows = np.array([joint.row for joint in rig.joints])
    answer = read_accelerations(rig, receptance(rig, lines, rows.T), lines)
    reading[:, 1:] = -np.einsum("foj,jcf->cfo", answer, _transform(steps, lines, rate_hz))
    return reading


def rest_forces(
    rig: Rig, columns: tuple[int, ...], pulses: HalfSinePulses, seconds: float, rate_hz: float
) -> Real:
    """Return the rest of each joint's force at every sample; (n_joint, n_hit, n_sample)."""
    if rig.laws:
        raise TruthError("a stiffness that depends on frequency has no place in the time domain")
    modes = _modes(rig, rate_hz)
    hits, drive = len(pulses.peak), list(columns)
    count = round(seconds * rate_hz)
    forces = np.zeros((len(rig.joints), hits, count + 1))
    solver = _Implicit(rig.joints, modes.compliance, hits)
    struck, motion = np.zeros((2, len(modes.decay), hits), np.complex128)
    rest = forces[:, :, 0]
    last = round(float(pulses.duration.max()) * rate_hz) + 1
    turning = modes.roots.imag[modes.roots.imag > 0]
    period = 2 * np.pi / turning.min() if len(turning) else seconds
    look, largest = max(1, round(min(_LOOK * float(period), seconds) * rate_hz)), 0.0
    for n in range(1, count + 1):
        motion *= modes.decay
        motion -= modes.rest @ rest
        if n <= last:
            now = modes.drive[:, drive] * pulses.answer(modes.roots, n / rate_hz)
            motion += now - modes.decay * struck
            struck = now
        rest = solver.solve((modes.read @ motion).real, rest)
        forces[:, :, n] = rest
        if n % look == 0:
            recent = float(np.abs(np.diff(forces[:, :, n - look : n + 1])).max())
            largest = max(largest, recent)
            if n > last + look and recent <= _QUIET * largest:
                forces[:, :, n:] = rest[:, :, None]
                break
    return forces


class _Implicit:
    """Finds the force that the stretch, which it lessens, makes.

    By repetition, every third time from where the steps before lead to (Aitken 1926): exact where
    the law is a straight line.
    """

    def __init__(self, joints: tuple[NonlinearJoint, ...], compliance: Real, hits: int) -> None:
        self.laws, self.compliance = [joint.law for joint in joints], compliance
        self.state = np.array([law.start(hits) for law in self.laws])
        self.size = 0.0

    def solve(self, free: Real, rest: Real) -> Real:
        """Return the rest that a stretch without it leads to, and keep the joints' state."""
        new, state = np.empty_like(rest), np.empty_like(self.state)
        before = step = rest
        for turn in range(_MAX_REPETITIONS):
            stretch = free - self.compliance @ rest
            for number, law in enumerate(self.laws):
                new[number], state[number] = law.force(stretch[number], self.state[number])
            ahead = new - rest
            off = float(np.maximum.reduce(np.abs(ahead), axis=None))
            if off > _SETTLED * self.size:
                self.size = max(self.size, float(np.abs(new).max()))
            if off <= _SETTLED * self.size:
                self.state = state
                return new
            before, step, rest = rest, ahead, _leap(before, step, ahead, new, turn)
        raise TruthError("a nonlinear joint is too stiff for the time step; it does not settle")


def _leap(before: Real, step: Real, ahead: Real, new: Real, turn: int) -> Real:
    """Where to repeat from: what came out, or every third time what the last two steps lead to."""
    if turn % 3 != 1:
        return new.copy()
    bend = ahead - step
    straight = bend != 0
    return np.where(straight, before - step**2 / np.where(straight, bend, 1.0), new)


@dataclass(frozen=True, eq=False)
class _Modes:
    """Propagation over one step in complex modes, one of each conjugate pair.

    Args:
        decay: e^{lambda h}; (n_mode, 1).
        read: stretch of the joints is the real part of read @ z; (n_joint, n_mode).
        roots: lambda [rad/s]; (n_mode,).
        drive: b of the hammers; (n_mode, n_in).
        rest: of the joints, from one sample to the next, z without the force of its own sample:
            gamma_0 b + e^{lambda h} gamma_1 b; (n_mode, n_joint).
        compliance: stretch per force in the same sample; (n_joint, n_joint).
    """

    decay: Complex
    read: Complex
    roots: Complex
    drive: Complex
    rest: Complex
    compliance: Real


def _modes(rig: Rig, rate_hz: float) -> _Modes:
    basis, equations = null_basis(rig.equations), rig.equations
    mass, damping, stiffness = (
        basis.T @ matrix @ basis
        for matrix in (equations.mass, equations.damping, equations.stiffness)
    )
    rows = np.array([joint.row for joint in rig.joints]) @ basis
    size = len(mass)
    dynamics = np.zeros((2 * size, 2 * size))
    dynamics[:size, size:] = np.eye(size)
    dynamics[size:] = -np.linalg.solve(mass, np.hstack([stiffness, damping]))
    forces = np.linalg.solve(mass, np.hstack([basis.T @ rig.drive, rows.T]))
    roots, vectors = scipy.linalg.eig(dynamics)
    entry = np.linalg.solve(vectors, np.vstack([np.zeros_like(forces), forces]).astype(complex))
    keep = roots.imag >= 0
    roots, entry = roots[keep], entry[keep]
    read = rows @ vectors[:size, keep] * np.where(roots.imag > 0, 2.0, 1.0)
    before, after = (weight / rate_hz for weight in _weights(roots / rate_hz))
    inputs = rig.drive.shape[1]
    rest_after = after[:, None] * entry[:, inputs:]
    return _Modes(
        np.exp(roots / rate_hz)[:, None],
        read,
        roots,
        entry[:, :inputs],
        before[:, None] * entry[:, inputs:] + np.exp(roots / rate_hz)[:, None] * rest_after,
        (read @ rest_after).real,
    )


def _weights(turn: Complex) -> tuple[Complex, Complex]:
    """Return gamma_0 / h and gamma_1 / h of lambda h, by their series where that is small."""
    small = np.abs(turn) < 1e-2
    safe = np.where(small, 1.0, turn)
    growth = np.expm1(safe) / safe
    after = np.where(small, 1 / 2 + turn / 6 + turn**2 / 24 + turn**3 / 120, (growth - 1) / safe)
    whole = np.where(small, 1 + turn / 2 + turn**2 / 6 + turn**3 / 24 + turn**4 / 120, growth)
    return whole - after, after


def _transform(samples: Real, freq_hz: Real, rate_hz: float) -> Complex:
    """Fourier transform of broken lines through the samples, their last value held for ever.

    With i w X the transform of the slope, constant between samples:
    X = sum_n (x_{n+1} - x_n) e^{-i w t_n} (1 - e^{-i w h}) / ((i w)^2 h).
    """
    steps = np.diff(samples)
    line = steps.shape[-1] / rate_hz  # the lines are multiples of one over it
    spectrum = np.fft.fft(steps)[..., np.rint(freq_hz * line).astype(int)]
    s = 2j * np.pi * freq_hz
    return spectrum * -np.expm1(-s / rate_hz) * rate_hz / s**2
