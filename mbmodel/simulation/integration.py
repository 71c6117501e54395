r"""Integration in time by MuJoCo, natively and in threads, and the motion of the probes.

A force is constant over each step: its mean over that step. The acceleration of a probe is the
difference of its velocity over the step, so that it is the mean of the same time. Both belong to
the middle of the step, without a delay between them. In a linear machine this divides the part of
the motion that is not inertia alone by (w h / 2)^2 / sin^2(w h / 2), 1 + (w h)^2 / 12: 1.3e-3 at
200 Hz with h = 1e-4 s.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

import mujoco
import mujoco.rollout
import numpy as np

from identification.words import ConvergenceError, Real
from mbmodel.nonlinear_joints.friction_solver import IMPEDANCE_RANGE, set_friction_solver
from mbmodel.simulation.drives import CONTROL_SPEC, rest_controls
from mbmodel.simulation.joint_reach import JointReach, unstable_springs
from mbmodel.simulation.time_model import TimeModel

_MAX_INTEGRATED_BYTES = 100e6  # memory of states, sensor data and controls of a chunk of steps
_MAX_CHUNK_STEPS = 8192
INTEGRATORS = {
    "RK4": mujoco.mjtIntegrator.mjINT_RK4,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "discrete": mujoco.mjtIntegrator.mjINT_DISCRETE,
}

# Returns the inputs' means over the steps from a first to a last one; (n_record, n_step, n_in).
InputMeans = Callable[[int, int], Real]


class Advance(Protocol):
    """Takes steps of one record with more than inputs that are known beforehand."""

    def __call__(self, state: Real, control: Real) -> tuple[Real, Real]:
        """Return states after the steps, and sensor data at their beginnings; (1, n_step, n).

        Args:
            state: at the beginning; (1, n_state).
            control: of all that is known; (1, n_step, n_control).
        """

    def read_record(self) -> Real:
        """Return further signals at the instants of the record; (n_signal, n_time)."""


@dataclass(frozen=True)
class TimeStep:
    """How the integration steps, and how exact it is.

    Args:
        integrator: ``RK4``, ``implicitfast`` or ``discrete``.
        step_s: length of a step [s].
        error: estimated error of the readings, relative to each channel's rms, the largest; NaN if
            it was not estimated.
        span_s: time over which it was estimated [s].
    """

    integrator: str
    step_s: float
    error: float = float("nan")
    span_s: float = 0.0


def integrate(
    model: TimeModel,
    gains: Real,
    means: InputMeans,
    count: int,
    step: TimeStep,
    *,
    threads: int = 1,
    reach: JointReach | None = None,
    advance: Advance | None = None,
) -> Iterator[Real]:
    """Integrate one or several records at once, and yield the motion chunk by chunk.

    Args:
        gains: entries of the control vector per unit of each input; (n_record, n_control, n_in).
        means: mean of the inputs over each step.
        count: number of steps.
        step: integrator and length of the step.
        threads: that work at the same time.
        reach: takes note of how far the joints move.
        advance: takes the steps, with control loops closed; None for MuJoCo's own rollout.

    Yields:
        Motion in the middle of the steps, relative to rest, in the model's order of
        differentiation; (n_record, n_step, n_channel).

    Raises:
        ConvergenceError: the motion grows without bound.
    """
    compiled = model.compiled
    compiled.opt.integrator = INTEGRATORS[step.integrator]
    compiled.opt.timestep = step.step_s
    set_friction_solver(compiled, step.step_s)
    if not model.machine.reading.soft_equalities:
        _stiffen_chains(compiled, step.step_s)
    records = len(gains)
    workers = [mujoco.MjData(compiled) for _ in range(max(1, min(threads, records)))]
    state = np.tile(model.start, (records, 1))
    rest = rest_controls(model)
    row_bytes = 8 * records * (len(rest) + len(model.start) + compiled.nsensordata)
    chunk = int(np.clip(_MAX_INTEGRATED_BYTES / row_bytes, 64, _MAX_CHUNK_STEPS))
    last: Real | None = None
    with mujoco.rollout.Rollout(nthread=len(workers) if len(workers) > 1 else 0) as pool:
        # One step more than asked for: the last difference needs the velocity at its end.
        for start in range(0, count + 1, chunk):
            stop = min(start + chunk, count + 1)
            inputs = means(start, stop)
            control = np.einsum("rnk,rck->rnc", inputs, gains) + rest
            states, sensors = (
                advance(state, control)
                if advance is not None
                else pool.rollout(
                    compiled, workers, state, control, control_spec=CONTROL_SPEC, chunk_size=1
                )
            )
            state = states[:, -1]
            _check_progress(model, states, stop, step)
            if reach is not None:
                reach.extend(states)
            rows = sensors if last is None else np.concatenate([last, sensors], axis=1)
            last = sensors[:, -1:]
            if rows.shape[1] > 1:
                yield _motion(model, rows, step.step_s)


def _stiffen_chains(compiled: mujoco.MjModel, step_s: float) -> None:
    """Let closed chains give way as little as MuJoCo can integrate.

    A gap decays within two steps, critically damped. Its stiffness is that of the constraint's mass
    times 1e4 / (4 h^2), so that an estimate that compares steps sees how it gives way.
    """
    compiled.eq_solref[:, :2] = 2 * step_s, 1.0
    compiled.eq_solimp[:, :2] = IMPEDANCE_RANGE[1]


def _check_progress(model: TimeModel, states: Real, stop: int, step: TimeStep) -> None:
    """Raise ConvergenceError if MuJoCo stopped or left the numbers."""
    time = states[:, -1, 0] - model.start[0]
    if not (np.isfinite(states[:, -1]).all() and np.allclose(time, stop * step.step_s, rtol=1e-6)):
        raise ConvergenceError(
            f"{model.machine.source}: the motion grows without bound before "
            f"{stop * step.step_s:.3g} s: "
            + (cause_of_growth(model) or "the machine is unstable, or the inputs are out of scale")
        )


def cause_of_growth(model: TimeModel) -> str:
    """Return why a motion grows without bound, with a remedy; empty if no joint's law does it."""
    phrases = unstable_springs(model.compiled)
    return f"{'; '.join(phrases)}: change the law, or lower the inputs" if phrases else ""


def _motion(model: TimeModel, rows: Real, step_s: float) -> Real:
    """Return the motion in the middle of the steps between rows of sensor data.

    Args:
        rows: sensor data at the beginning of the steps; (n_record, n_step + 1, n_sensor).

    Returns:
        (n_record, n_step, n_channel).
    """
    probes = rows[:, :, model.probe_columns.ravel()]
    if model.order == 0:
        shape = (*rows.shape[:2], len(model.probe_columns), 7)
        moved = probes - model.rest[model.probe_columns.ravel()]
        places = np.concatenate(
            [moved.reshape(shape)[..., :3], rotation_vectors(probes.reshape(shape)[..., 3:])],
            axis=-1,
        ).reshape(*rows.shape[:2], -1)
        motion = (places[:, 1:] + places[:, :-1]) / 2
    else:
        motion = (
            np.diff(probes, axis=1) / step_s
            if model.order == 2
            else (probes[:, 1:] + probes[:, :-1]) / 2 - model.rest[model.probe_columns.ravel()]
        )
    joints = rows[:, :, model.encoder_columns] - model.rest[model.encoder_columns]
    return np.concatenate([motion, (joints[:, 1:] + joints[:, :-1]) / 2], axis=2)


def rotation_vectors(quaternions: Real) -> Real:
    """Return rotation vectors of unit quaternions (scalar first); (..., 3)."""
    real, vector = quaternions[..., :1], quaternions[..., 1:]
    vector = np.where(real < 0, -vector, vector)
    size = np.linalg.norm(vector, axis=-1, keepdims=True)
    angle = 2 * np.arctan2(size, np.abs(real))
    ratio = np.where(size > 0, angle / np.where(size > 0, size, 1.0), 2.0)
    return ratio * vector
