r"""Sampled control loops around a machine, with the images of the sampler.

Controllers read y(k T) and hold their outputs, u = -K(z) y, z = exp(s T). Between samples the
machine moves freely, so that the plant that they see is its zero-order-hold equivalent G_d(z), and

    u(s) = -h(s) exp(-s tau) K(z) (1 + G_d(z) K(z))^-1 (G_yd d + n)
    h(s) = (1 - exp(-s T)) / (s T)

is the part of the held control at the frequency of d (Astrom and Wittenmark 1997, ch. 7). All of
``loop_algebra`` holds with K = h exp(-s tau) K(z), and with the return difference

    1 + G_yu K + A(s),     A = (G_d(z) - G_yu(s) h(s) exp(-s tau)) K(z)

A is the share of the images of the sampler at s + 2 pi i k / T. It comes from the state space, and
all else from the FRFs, so that laws of springs stay exact. The poles are log(z) / T, z those of
G_d and K in one loop.
"""

from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Loop, Real, between_multiples, zero_order_hold
from mbmodel import Model, SystemMatrices
from mbmodel.export.discrete import SampledSystem, discretise, split_delay
from tuning.plant.error_budget.definition import BudgetDefinition, sampling_period
from tuning.plant.error_budget.joined_states import (
    LoopStates,
    control_plant,
    join_loops,
    machine_states,
)
from tuning.plant.error_budget.loop_algebra import PortMap

# Of the modal matrix: beyond it modes nearly coincide, and each line is solved by itself.
_MAX_VECTOR_CONDITION = 1e7
_WAIT_OF_SAMPLE = 1e-6  # of a period, from the sample to the change of a control without delay


@dataclass(frozen=True, eq=False)
class LoopAliases:
    """Share of the images of the sampler in the loop gains: A of the module.

    Args:
        loops: closed loops, all of one period.
        plant: from their controls to their measurements; None for continuous loops.
    """

    loops: tuple[Loop, ...]
    plant: SystemMatrices | None

    @classmethod
    def of(
        cls, model: Model, theta: Real, definition: BudgetDefinition, ports: PortMap
    ) -> "LoopAliases":
        """Return the images of a budget's loops around a machine.

        Args:
            model: machine and Parts.
            theta: parameters in SI; (n_parameter,).
            definition: loops.
            ports: labels.
        """
        if not sampling_period(definition.loops):
            return cls(definition.loops, None)
        states = machine_states(model, theta, definition, ports)
        return cls(definition.loops, control_plant(*states, ports).balance_units())

    def at(self, laplace: Complex) -> Complex:
        """Return A at each s = i w [rad/s]; (n_freq, n_loop, n_loop)."""
        count = len(self.loops)
        if self.plant is None:
            return np.zeros((len(laplace), count, count), complex)
        period = sampling_period(self.loops)
        laplace = between_multiples(laplace, period)
        turn = np.exp(laplace * period)
        hold = np.stack([held_law(loop, laplace) for loop in self.loops], axis=-1)
        gains = np.stack(
            [loop.controller.sampled_response(laplace) for loop in self.loops], axis=-1
        )
        poles, vectors = np.linalg.eig(self.plant.a)
        if not len(poles) or np.linalg.cond(vectors) > _MAX_VECTOR_CONDITION:
            sampled = sample_plant(self.plant, self.loops).system.at(turn)
            return np.asarray(
                (sampled - self.plant.at(laplace) * hold[:, None, :]) * gains[:, None, :]
            )
        drive = np.linalg.solve(vectors, self.plant.b.astype(complex))
        reading = self.plant.c @ vectors
        images = np.zeros((len(laplace), count, count), complex)
        delays = arrival_delays(self.plant, self.loops)
        for column in range(count):
            periods, late = split_delay(float(delays[column]), period)
            early = period - late
            factors = _integral(poles, early), np.exp(poles * early) * _integral(poles, late)
            held = (factors[0] + factors[1] / turn[:, None]) / (
                turn[:, None] - np.exp(poles * period)
            )
            terms = held * turn[:, None] ** -periods
            terms = terms - hold[:, [column]] / (laplace[:, None] - poles)
            images[:, :, column] = np.einsum("or,fr,r->fo", reading, terms, drive[:, column])
            through = turn ** -(periods + (late > 0)) - hold[:, column]
            images[:, :, column] += through[:, None] * self.plant.d[:, column]
        return np.asarray(images * gains[:, None, :])


def held_law(loop: Loop, laplace: Complex) -> Complex:
    """Return h(s) exp(-s tau) of a sampled loop at each s [rad/s]; (n_freq,)."""
    hold = zero_order_hold(laplace, loop.controller.period_s)
    return np.asarray(hold * np.exp(-laplace * loop.delay))


def sample_plant(plant: SystemMatrices, loops: tuple[Loop, ...]) -> SampledSystem:
    """Return the plant of sampled loops in discrete time, with the delay of each loop."""
    return discretise(plant, sampling_period(loops), arrival_delays(plant, loops))


def arrival_delays(plant: SystemMatrices, loops: tuple[Loop, ...]) -> Real:
    """Return the delay after which each control reaches the machine [s]; (n_loop,).

    A measurement that follows a control at once, such as an acceleration, is sampled before the
    control changes: it holds the value of the period before.
    """
    is_direct = (plant.d != 0).any(axis=0)
    wait = np.where(is_direct, _WAIT_OF_SAMPLE * sampling_period(loops), 0.0)
    delays: Real = np.array([loop.delay for loop in loops]) + wait
    return delays


def sampled_states(
    model: Model, theta: Real, definition: BudgetDefinition, ports: PortMap
) -> LoopStates:
    """Return the state space of a machine with sampled loops, in discrete time.

    Args:
        model: machine and Parts.
        theta: parameters in SI; (n_parameter,).
        definition: loops, all of one sampling period.
        ports: labels.
    """
    loops = definition.loops
    plant = control_plant(*machine_states(model, theta, definition, ports), ports)
    sampled = sample_plant(plant, loops)
    controllers = [
        (each.dynamics, each.input_matrix, each.output_matrix, each.feedthrough)
        for each in (loop.controller for loop in loops)
    ]
    count = len(loops)
    gain = np.zeros((sampled.system.order, count))
    return join_loops(sampled.system, controllers, gain, np.eye(count), sampled.period_s)


def _integral(poles: Complex, time_s: float) -> Complex:
    """Return the integral of exp(pole t) from 0 to a time; (n_pole,)."""
    is_zero = poles == 0
    values = np.expm1(poles * time_s) / np.where(is_zero, 1.0, poles)
    return np.where(is_zero, time_s, values)
