r"""Poles and modes of a machine with its control loops; a delay is Pade's fraction.

The inputs are accelerations of the floor and forces, velocities and displacements of the floor as
inputs of their own (so that nothing is integrated), and noise.

Sampled control loops around a machine, with the images of the sampler.

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

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.words import (
    Complex,
    InputError,
    Loop,
    Real,
    between_multiples,
    sampling_period,
    zero_order_hold,
)
from mbmodel import Model, SystemMatrices
from mbmodel.control_loops.loop_law import DelayFraction
from mbmodel.export.discrete import SampledSystem, discretise, split_delay
from tuning.control_loops.stability import growing_pole
from tuning.plant.error_budget.definition import BudgetDefinition
from tuning.plant.error_budget.joined_states import (
    LoopStates,
    control_plant,
    join_loops,
    machine_states,
)
from tuning.plant.error_budget.loop_algebra import PortMap

_LEAST_RESOLVED_DAMPING = 1e-7  # of a pole: no frequency lines resolve less
_PEAK_AND_FOOT = 1e-8, 1e-5  # of its inner lines and its foot, over its frequency
_MIN_DRIVEN_PEAK = 1e3  # of the density over that of its foot: less is rounding
_DELAY_ORDER = 8  # of Pade's fraction: its phase is right to 1e-6 rad while w tau < 6


def loop_states(
    model: Model, theta: Real, definition: BudgetDefinition, ports: PortMap
) -> LoopStates:
    """Return the state space of the machine with its loops.

    Args:
        theta: parameters in SI; (n_parameter,).
    """
    if sampling_period(definition.loops):
        return sampled_states(model, theta, definition, ports)
    count = len(definition.loops)
    machine, read, direct = machine_states(model, theta, definition, ports)
    if not count:
        none = np.zeros((0, len(machine.dynamics))), np.zeros((0, 0))
        return LoopStates(machine.dynamics, machine.gain, ports.errors @ machine.readout, *none)
    gain = np.hstack([machine.gain, np.zeros((len(machine.gain), count))])
    joined = join_loops(
        control_plant(machine, read, direct, ports),
        [_controller_states(loop) for loop in definition.loops],
        gain,
        np.hstack([direct, np.eye(count)]),
    )
    readout = np.zeros((len(ports.errors), len(joined.dynamics)))
    readout[:, : len(machine.dynamics)] = ports.errors @ machine.readout
    return replace(joined, readout=readout)


def _controller_states(loop: Loop) -> tuple[Real, Real, Real, Real]:
    """Return A, B, C, D of a controller and its delay, one after the other."""
    controller = loop.controller
    matrices = (
        controller.dynamics,
        controller.input_matrix,
        controller.output_matrix,
        controller.feedthrough,
    )
    if not loop.delay:
        return matrices
    fraction = DelayFraction(loop.delay, _DELAY_ORDER)
    dynamics, drive, output = fraction.states()
    constant = 1.0 + fraction.constant
    states, entry, read, through = matrices
    zero = np.zeros((len(states), len(dynamics)))
    return (
        np.block([[states, zero], [drive[:, None] @ read, dynamics]]),
        np.vstack([entry, drive[:, None] @ through]),
        np.hstack([constant * read, output[None]]),
        constant * through,
    )


def refuse_unstable(
    poles: Complex, loops: Sequence[Loop], *, samples: tuple[int, int] | None = None
) -> None:
    """Refuse a machine, or a machine with loops, that is unstable.

    Args:
        poles: of the machine with its loops [rad/s]; (n,).
        loops: that are closed.
        samples: numbers of unstable and of all machines, if it is drawn from the posterior.

    Raises:
        InputError: a pole grows.
    """
    pole = growing_pole(poles)
    if pole is None:
        return
    where = "the machine" if not loops else "the closed loop"
    names = ", ".join(loop.name for loop in loops)
    remedy = (
        f"change the gain of {names} or turn its phase there"
        if loops
        else ("correct its springs and dampers")
    )
    frequency = abs(pole.imag) / (2 * np.pi)
    at = f"{frequency:.4g} Hz" if frequency else "0 Hz"
    whole = "" if samples is None else f" in {samples[0]} of {samples[1]} machines of the posterior"
    raise InputError(
        f"{where} is unstable{whole}: the pole {pole.real:.4g} {pole.imag:+.4g}i rad/s at {at} "
        f"grows, so that the error has no rms value; {remedy}"
    )


def refuse_undamped(poles: Complex, loops: Sequence[Loop], freq_hz: Real, density: Real) -> None:
    """Refuse a pole without damping in the band that the sources drive.

    Args:
        poles [rad/s] (n,), loops: as for ``refuse_unstable``.
        freq_hz: lines of the integral [Hz]; (n_freq,).
        density: of each error; (n_freq, n_error).

    Raises:
        InputError: the density peaks at such a pole, so that its integral has no limit.
    """
    inner, foot = _PEAK_AND_FOOT
    for pole in poles[
        (poles.imag > 0) & (np.abs(poles.real) < _LEAST_RESOLVED_DAMPING * np.abs(poles))
    ]:
        frequency = pole.imag / (2 * np.pi)
        distance = np.abs(freq_hz / frequency - 1)
        peak = density[distance < inner].max(axis=0, initial=0.0)
        beside = np.flatnonzero(distance > foot)
        nearest = beside[np.argsort(distance[beside])[:2]]
        if (peak > _MIN_DRIVEN_PEAK * density[nearest].max(axis=0, initial=0.0)).any():
            where = "the closed loop" if loops else "the machine"
            remedy = "lower the gain of the loops" if loops else "give its springs damping"
            raise InputError(
                f"{where} has a pole without damping at {frequency:.4g} Hz that the sources drive, "
                f"so that the error has no finite rms value; {remedy}"
            )


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
            theta: parameters in SI; (n_parameter,).
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
    return np.array([loop.delay for loop in loops]) + wait


def sampled_states(
    model: Model, theta: Real, definition: BudgetDefinition, ports: PortMap
) -> LoopStates:
    """Return the state space of a machine with sampled loops, in discrete time.

    Args:
        theta: parameters in SI; (n_parameter,).
        definition: loops, all of one sampling period.
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
