r"""A machine in state space without integrators, and joined with controllers, in either time.

The machine x' = A x + B_w w + B_u u, y = C x + D_w w + D_u u and the controllers
x_k' = A_k x_k + B_k y, u = -(C_k x_k + D_k y) give

    E = (1 + D_k D_u)^-1
    A_cl = [A - B_u E D_k C,          -B_u E C_k            ]   B_cl = [B_w - B_u E D_k D_w      ]
           [B_k (C - D_u E D_k C),     A_k - B_k D_u E C_k  ]          [B_k (1 - D_u E D_k) D_w  ]

In discrete time x[k+1] stands in place of x'.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from identification.words import Complex, Quantity, Real
from mbmodel import FrfRequest, Model, SystemMatrices, export_state_space, system_poles
from tuning.plant.error_budget.definition import BudgetDefinition
from tuning.plant.error_budget.loop_algebra import PortMap

_FIT_LINES = 400  # at which laws such as losses are approximated
_QUANTITIES: tuple[Quantity, ...] = ("receptance", "mobility", "accelerance")


@dataclass(frozen=True, eq=False)
class MachineStates:
    """The machine's x' = A x + B w and outputs of one quantity, C x + D w."""

    dynamics: Real
    gain: Real
    readout: Real
    feedthrough: Real


def machine_states(
    model: Model, theta: Real, definition: BudgetDefinition, ports: PortMap
) -> tuple[MachineStates, Real, Real]:
    """Return the machine with its positions as outputs, and what the loops measure.

    Args:
        theta: parameters in SI; (n_parameter,).
        definition: loops, and the band in which laws are approximated.

    Returns:
        The machine; C of the measurements, (n_loop, n), and D of them by its inputs,
        (n_loop, 3 n_in).
    """
    lines, loops = np.geomspace(*definition.band, _FIT_LINES), definition.loops
    orders = {0, *(loop.measured.derivative for loop in loops)}
    machine = {order: _machine_states(model, theta, ports, lines, order) for order in orders}
    base = machine[0]
    rows = list(zip(ports.measured, loops, strict=bool(loops)))
    size = len(base.dynamics), base.feedthrough.shape[1]
    read, direct = np.zeros((len(loops), size[0])), np.zeros((len(loops), size[1]))
    for number, (row, loop) in enumerate(rows):
        measured = machine[loop.measured.derivative]
        read[number], direct[number] = row @ measured.readout, row @ measured.feedthrough
    return base, read, direct


def control_plant(
    machine: MachineStates, read: Real, direct: Real, ports: PortMap
) -> SystemMatrices:
    """Return the machine from the controls of the loops to their measurements.

    Args:
        machine: with its positions as outputs.
        read: C of the measurements; (n_loop, n).
        direct: D of them by its inputs; (n_loop, 3 n_in).
    """
    inputs = len(ports.inputs)
    entry, through = machine.gain[:, :inputs], direct[:, :inputs]
    return SystemMatrices(machine.dynamics, entry @ ports.controls, read, through @ ports.controls)


def _machine_states(
    model: Model, theta: Real, ports: PortMap, lines: Real, order: int
) -> MachineStates:
    """Return the machine without integrators, its outputs in a quantity.

    Args:
        lines: at which laws are approximated [Hz]; (n_freq,).
        order: number of time derivatives of the outputs.
    """
    request = FrfRequest(lines, ports.outputs, ports.inputs, _QUANTITIES[order])
    system = export_state_space(model, theta, request).system
    floor = {str(port) for port in ports.inputs if str(port).startswith("floor:")}
    integrates = np.array([label.removesuffix("'") in floor for label in system.state_labels])
    kept, integrators = np.flatnonzero(~integrates), np.flatnonzero(integrates)
    count, inputs = len(ports.outputs), len(ports.inputs)
    feedthrough = np.zeros((count, 3 * inputs))
    feedthrough[:, :inputs] = system.D
    if len(integrators):  # displacements of the moving inputs, then their velocities
        moving = [k for k, port in enumerate(ports.inputs) if str(port) in floor]
        positions, rates = integrators.reshape(2, -1)
        feedthrough[:, [2 * inputs + k for k in moving]] = system.C[:, positions]
        feedthrough[:, [inputs + k for k in moving]] = system.C[:, rates]
    gain = np.zeros((len(kept), 3 * inputs))
    gain[:, :inputs] = system.B[kept]
    return MachineStates(system.A[np.ix_(kept, kept)], gain, system.C[:, kept], feedthrough)


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
        period_s: sampling period of the loops [s], for states from the noise alone, in discrete
            time; 0 in continuous time.
    """

    dynamics: Real
    gain: Real
    readout: Real
    reading: Real
    noise_through: Real
    period_s: float = 0.0

    def poles(self) -> Complex:
        """Return the poles, of sampled loops log(z) / T [rad/s]; (n,)."""
        return system_poles(self.dynamics, self.period_s)

    def modal_terms(self) -> tuple[Complex, Complex, Complex]:
        """Return poles (n,), c_r (n_error, n) and b_r (n, 3 n_in + n_loop), in continuous time."""
        poles, vectors = np.linalg.eig(self.dynamics)
        return poles, self.readout @ vectors, np.linalg.solve(vectors, self.gain.astype(complex))


def join_loops(
    plant: SystemMatrices,
    controllers: Sequence[tuple[Real, Real, Real, Real]],
    gain: Real,
    by_input: Real,
    period_s: float = 0.0,
) -> LoopStates:
    """Return plant and controllers as one state space, without the readout of errors.

    Args:
        plant: from the controls to the measurements of the loops.
        controllers: A_k, B_k, C_k, D_k of each loop.
        gain: B_w; (n, n_w).
        by_input: D_w; (n_loop, n_w).
        period_s: sampling period of discrete time [s]; 0 in continuous time.
    """
    states, drive, output, through = (
        block_diag(*matrices) for matrices in zip(*controllers, strict=True)
    )
    inverse = np.linalg.inv(np.eye(len(plant.d)) + through @ plant.d)
    seen = np.eye(len(plant.d)) - plant.d @ inverse @ through
    dynamics = np.block(
        [
            [plant.a - plant.b @ inverse @ through @ plant.c, -plant.b @ inverse @ output],
            [drive @ seen @ plant.c, states - drive @ plant.d @ inverse @ output],
        ]
    )
    total = np.vstack([gain - plant.b @ inverse @ through @ by_input, drive @ seen @ by_input])
    reading = np.hstack([seen @ plant.c, -plant.d @ inverse @ output])
    return LoopStates(dynamics, total, np.zeros((0, len(dynamics))), reading, seen, period_s)
