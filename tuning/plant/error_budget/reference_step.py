"""Response of closed loops to a step of their reference: u = -K (y - r), all loops closed.

The reference enters where the noise does, with the opposite sign: r = -n. The state space x' = A x
+ b n is stepped exactly by the matrix exponential; delays are Pade's fractions.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from identification.words import Real, poles_in_s
from tuning.plant.control_loops.stability_margins import AllMargins
from tuning.plant.error_budget.closed_loop_states import loop_states
from tuning.plant.error_budget.joined_states import LoopStates
from tuning.plant.error_budget.loop_plant import LoopPlant

# Time constants of the slowest pole that is seen, within periods of the crossover; steps in it.
_TIME_CONSTANTS, _PERIODS_OF_CROSSOVER, _TIME_STEPS = 5.0, (10.0, 200.0), 4000
_MIN_POLE_OF_A_STEP = 1e-9  # of the fastest pole: slower ones are motions that no loop sees
# Final value over the largest response: a loop whose gain vanishes at 0 Hz returns to zero, apart
# from rounding, and figures relative to less than this do not say how it follows.
_MIN_FINAL_SHARE = 1e-3
_RISE_SHARES, _SETTLED_WITHIN = (0.1, 0.9), 0.02  # shares of the final value


@dataclass(frozen=True, eq=False)
class ReferenceStep:
    """Response of what a loop measures to a unit step of its reference.

    Args:
        time_s: [s]; (n_time,).
        response: (n_time,).
        final: value at the end of all time.
    """

    time_s: Real
    response: Real
    final: float

    @property
    def overshoot(self) -> float:
        """Largest value above the final one, relative to it."""
        return max(0.0, float(self.response.max() / self.final) - 1)

    @property
    def rise_time_s(self) -> float | None:
        """Time from 10 to 90 % of the final value [s]; None if it is not reached."""
        ratio = self.response / self.final
        if not (ratio >= _RISE_SHARES[1]).any():
            return None
        ends = []
        for share in _RISE_SHARES:
            k = int(np.argmax(ratio >= share))
            part = (share - ratio[k - 1]) / (ratio[k] - ratio[k - 1]) if k else 0.0
            ends.append(self.time_s[max(k - 1, 0)] + part * (self.time_s[1] - self.time_s[0]))
        return float(ends[1] - ends[0])

    @property
    def settling_time_s(self) -> float | None:
        """Time after which the response stays within 2 % [s]; None if it does not settle."""
        outside = np.flatnonzero(np.abs(self.response / self.final - 1) > _SETTLED_WITHIN)
        if not len(outside):
            return 0.0
        last = int(outside[-1])
        return None if last == len(self.time_s) - 1 else float(self.time_s[last + 1])


def reference_steps(
    plant: LoopPlant, theta: Real, margins: AllMargins
) -> tuple[ReferenceStep | None, ...]:
    """Return the response of each loop to a step of its own reference; n_loop.

    Args:
        plant: FRFs between the ports of the loops, which are stable.
        theta: its parameters in SI; (n_theta,).
        margins: of the loops there.

    A loop without a crossover follows no reference, and one without gain at 0 Hz does not reach
    it: None.
    """
    states = loop_states(plant.model, theta, plant.definition, plant.ports)
    count, period = len(margins.loops), states.period_s
    points, vectors = np.linalg.eig(states.dynamics)
    poles = poles_in_s(points, period) if period else points
    is_moving = np.abs(poles) > _MIN_POLE_OF_A_STEP * np.abs(poles).max(initial=0.0)
    static = 1 / (1 - points[is_moving]) if period else -1 / poles[is_moving]
    steps: list[ReferenceStep | None] = []
    for number, loop in enumerate(margins.loops):
        if not loop.crossover.is_finite:
            steps.append(None)
            continue
        drive = -states.gain[:, -count + number]
        through = -float(states.noise_through[number, number])
        terms = (states.reading[number] @ vectors) * np.linalg.solve(vectors, drive.astype(complex))
        shares = terms[is_moving] * static
        final = float(1.0 + through + shares.sum().real)
        is_slow = np.abs(shares) > _SETTLED_WITHIN * abs(final)
        slowest = float(np.abs(poles[is_moving].real[is_slow]).min(initial=np.inf))
        shortest, longest = (periods / loop.crossover.value for periods in _PERIODS_OF_CROSSOVER)
        duration = float(np.clip(_TIME_CONSTANTS / slowest, shortest, longest))
        time, step = _transition(states, drive, duration)
        reading = np.append(states.reading[number], through)
        state, values = np.append(np.zeros(len(drive)), 1.0), np.empty(len(time))
        for k in range(len(time)):
            values[k] = 1.0 + reading @ state
            state = step @ state
        reaches = abs(final) > _MIN_FINAL_SHARE * np.abs(values).max()
        steps.append(ReferenceStep(time, values, final) if reaches else None)
    return tuple(steps)


def _transition(states: LoopStates, drive: Real, duration: float) -> tuple[Real, Real]:
    """Return instants [s] (n_time,) and the matrix from one to the next of a state and a constant.

    Args:
        states: of the loops.
        drive: of the states by the constant; (n,).
        duration: of the step, about [s].
    """
    size = len(drive)
    augmented = np.zeros((size + 1, size + 1))
    augmented[:size, :size], augmented[:size, size] = states.dynamics, drive
    if not states.period_s:
        time = np.linspace(0.0, duration, _TIME_STEPS + 1)
        return time, scipy.linalg.expm(augmented * time[1])
    augmented[size, size] = 1.0
    periods = int(np.ceil(duration / states.period_s / _TIME_STEPS))
    count = int(np.ceil(duration / states.period_s / periods))
    instants: Real = np.arange(count + 1, dtype=np.float64)
    return periods * states.period_s * instants, np.linalg.matrix_power(augmented, periods)
