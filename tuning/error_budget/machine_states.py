"""State space of a machine between the labels of a budget, without integrators."""

from dataclasses import dataclass

import numpy as np

from identification.words import Quantity, Real
from mbmodel import FrfRequest, Model, export_state_space
from mbmodel.export.system_matrices import SystemMatrices
from tuning.error_budget.definition import BudgetDefinition
from tuning.error_budget.loop_algebra import PortMap

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
        model: machine and Parts.
        theta: parameters in SI; (n_parameter,).
        definition: loops, and the band in which laws are approximated.
        ports: labels.

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
        ports: labels.
    """
    inputs = len(ports.inputs)
    entry, through = machine.gain[:, :inputs], direct[:, :inputs]
    return SystemMatrices(machine.dynamics, entry @ ports.controls, read, through @ ports.controls)


def _machine_states(
    model: Model, theta: Real, ports: PortMap, lines: Real, order: int
) -> MachineStates:
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
    return MachineStates(system.A[:size, :size], gain, system.C[:, :size], feedthrough)
