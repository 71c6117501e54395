r"""Poles and modes of a machine with its control loops.

The machine x' = A x + B_w w + B_u u, y = C x + D_w w + D_u u, in joint coordinates relative to the
floor, and the controllers x_k' = A_k x_k + B_k y, u = -(C_k x_k + D_k y) are joined:

    E = (1 + D_k D_u)^-1
    A_cl = [A - B_u E D_k C,          -B_u E C_k            ]   B_cl = [B_w - B_u E D_k D_w      ]
           [B_k (C - D_u E D_k C),     A_k - B_k D_u E C_k  ]          [B_k (1 - D_u E D_k) D_w  ]

A delay is Pade's fraction. The inputs w are accelerations of the floor and forces, velocities and
displacements of the floor as inputs of their own (so that nothing is integrated), and noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from identification.words import Complex, InputError, Loop, Quantity, Real
from mbmodel import FrfRequest, Model, export_state_space
from mbmodel.export.delay_fraction import DelayFraction
from tuning.control_loops.stability import growing_pole
from tuning.error_budget.definition import BudgetDefinition
from tuning.error_budget.loop_algebra import PortMap

_DELAY_ORDER = 8  # of Pade's fraction: its phase is right to 1e-6 rad while w tau < 6
_FIT_LINES = 400  # at which laws such as losses are approximated
_QUANTITIES: tuple[Quantity, ...] = ("receptance", "mobility", "accelerance")


@dataclass(frozen=True, eq=False)
class LoopStates:
    """State space of the machine with its loops, from w to the errors.

    Args:
        dynamics: A_cl; (n, n).
        gain: B_cl of accelerations and forces, velocities of the floor, its displacements, each
            n_in, and noise; (n, 3 n_in + n_loop).
        readout: C of the errors; (n_error, n).
        reading: C of what each controller reads, measurement and noise; (n_loop, n).
        noise_through: D of it by the noise; (n_loop, n_loop).
    """

    dynamics: Real
    gain: Real
    readout: Real
    reading: Real
    noise_through: Real

    def poles(self) -> Complex:
        """Return the poles [rad/s]; (n,)."""
        return np.asarray(np.linalg.eigvals(self.dynamics), complex)

    def modal_terms(self) -> tuple[Complex, Complex, Complex]:
        """Return poles (n,), c_r (n_error, n) and b_r (n, 3 n_in + n_loop) of the modes."""
        poles, vectors = np.linalg.eig(self.dynamics)
        return poles, self.readout @ vectors, np.linalg.solve(vectors, self.gain.astype(complex))


@dataclass(frozen=True, eq=False)
class _MachineStates:
    """The machine's x' = A x + B w and outputs of one quantity, C x + D w."""

    dynamics: Real
    gain: Real
    readout: Real
    feedthrough: Real


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
    lines = np.geomspace(*definition.band, _FIT_LINES)
    orders = {0, *(loop.measured.derivative for loop in definition.loops)}
    machine = {order: _machine_states(model, theta, ports, lines, order) for order in orders}
    base, loops = machine[0], definition.loops
    count, size = len(loops), len(base.dynamics)
    padding = np.zeros((len(base.gain), count))
    if not loops:
        none = np.zeros((0, size)), np.zeros((0, 0))
        return LoopStates(base.dynamics, base.gain, ports.errors @ base.readout, *none)
    read = np.stack(
        [
            row @ machine[loop.measured.derivative].readout
            for row, loop in zip(ports.measured, loops, strict=True)
        ]
    )
    direct = np.stack(
        [
            row @ machine[loop.measured.derivative].feedthrough
            for row, loop in zip(ports.measured, loops, strict=True)
        ]
    )
    gain = np.hstack([base.gain, padding])
    by_input = np.hstack([direct, np.eye(count)])
    entry = base.gain[:, : len(ports.inputs)] @ ports.controls
    by_control = direct[:, : len(ports.inputs)] @ ports.controls
    parts = [_controller_states(loop) for loop in loops]
    states, drive, output, through = (
        block_diag(*matrices) for matrices in zip(*parts, strict=True)
    )
    inverse = np.linalg.inv(np.eye(count) + through @ by_control)
    seen = np.eye(count) - by_control @ inverse @ through
    dynamics = np.block(
        [
            [base.dynamics - entry @ inverse @ through @ read, -entry @ inverse @ output],
            [drive @ seen @ read, states - drive @ by_control @ inverse @ output],
        ]
    )
    total_gain = np.vstack([gain - entry @ inverse @ through @ by_input, drive @ seen @ by_input])
    readout = np.zeros((len(ports.errors), len(dynamics)))
    readout[:, :size] = ports.errors @ base.readout
    reading = np.hstack([seen @ read, -by_control @ inverse @ output])
    return LoopStates(dynamics, total_gain, readout, reading, seen)


def _machine_states(
    model: Model, theta: Real, ports: PortMap, lines: Real, order: int
) -> _MachineStates:
    """Return the machine without integrators, its outputs in a quantity.

    Args:
        model: machine and Parts.
        theta: parameters in SI; (n_parameter,).
        ports: labels.
        lines: at which laws are approximated [Hz]; (n_freq,).
        order: number of time derivatives of the outputs.
    """
    request = FrfRequest(lines, ports.outputs, ports.inputs, _QUANTITIES[order])
    system = export_state_space(model, theta, request).system
    floor = {str(port) for port in ports.inputs if str(port).startswith("floor:")}
    integrators = sum(label.removesuffix("'") in floor for label in system.state_labels)
    size, count, inputs = len(system.A) - integrators, len(ports.outputs), len(ports.inputs)
    feedthrough = np.zeros((count, 3 * inputs))
    feedthrough[:, :inputs] = system.D
    if integrators:  # displacements of the moving inputs, then their velocities
        moving = [k for k, port in enumerate(ports.inputs) if str(port) in floor]
        positions, rates = size, size + len(moving)
        feedthrough[:, [2 * inputs + k for k in moving]] = system.C[:, positions:rates]
        feedthrough[:, [inputs + k for k in moving]] = system.C[:, rates:]
    gain = np.zeros((size, 3 * inputs))
    gain[:, :inputs] = system.B[:size]
    return _MachineStates(system.A[:size, :size], gain, system.C[:, :size], feedthrough)


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
        f"lower the gain of {names} or turn its phase there"
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
