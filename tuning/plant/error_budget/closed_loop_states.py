"""Poles and modes of a machine with its control loops; a delay is Pade's fraction.

The inputs are accelerations of the floor and forces, velocities and displacements of the floor as
inputs of their own (so that nothing is integrated), and noise.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identification.words import Complex, InputError, Loop, Real
from mbmodel import Model
from mbmodel.control_loops.delay_fraction import DelayFraction
from tuning.control_loops.stability import growing_pole
from tuning.plant.error_budget.definition import BudgetDefinition, sampling_period
from tuning.plant.error_budget.joined_states import (
    LoopStates,
    control_plant,
    join_loops,
    machine_states,
)
from tuning.plant.error_budget.loop_algebra import PortMap
from tuning.plant.error_budget.sampled_loops import sampled_states

_LEAST_RESOLVED_DAMPING = 1e-7  # of a pole: no frequency lines resolve less
_PEAK_AND_FOOT = 1e-8, 1e-5  # of its inner lines and its foot, over its frequency
_MIN_DRIVEN_PEAK = 1e3  # of the density over that of its foot: less is rounding
_DELAY_ORDER = 8  # of Pade's fraction: its phase is right to 1e-6 rad while w tau < 6


def loop_states(
    model: Model, theta: Real, definition: BudgetDefinition, ports: PortMap
) -> LoopStates:
    """Return the state space of the machine with its loops.

    Args:
        model: machine and Parts.
        theta: parameters in SI; (n_parameter,).
        definition: loops.
        ports: labels.
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
        poles: of the machine with its loops [rad/s]; (n,).
        loops: that are closed.
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
