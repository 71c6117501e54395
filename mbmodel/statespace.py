"""The linear model as a named state space of python-control."""

import control
import numpy as np

from identification.words import ORDER, Real
from mbmodel.model import Model
from mbmodel.response import Question


def state_space(model: Model, theta: Real, question: Question) -> control.StateSpace:
    """States, inputs and outputs by name; the question's frequencies do not matter.

    x = [q; q'], x' = [[0, 1], [-M^-1 K, -M^-1 C]] x + [0; M^-1 F] u; the outputs are G q, G q' or
    G q'' with G = L T: accelerance has a direct feed-through G M^-1 F.

    Args:
        model: machine and Parts.
        theta: parameters in SI; (n_parameter,).
        question: outputs, inputs and quantity.

    Returns:
        The system, 2 nv states named ``<coordinate>`` and ``<coordinate>'``.
    """
    matrices = model.matrices(theta)
    machine, layout = model.machine, model.machine.layout
    size = len(machine.coordinates)
    readout = layout.rows(question.outputs) @ machine.jacobian
    drive = (layout.rows(question.inputs) @ machine.jacobian).T
    accelerations = -np.linalg.solve(
        matrices.mass, np.hstack([matrices.stiffness, matrices.damping, -drive])
    )
    dynamics = np.vstack([np.eye(size, 2 * size, size), accelerations[:, : 2 * size]])
    gain = np.vstack([np.zeros_like(drive), accelerations[:, 2 * size :]])
    order = ORDER[question.quantity]
    feedthrough = np.zeros((len(readout), drive.shape[1]))
    if order == 2:
        reading, feedthrough = readout @ dynamics[size:], readout @ gain[size:]
    else:
        reading = np.zeros((len(readout), 2 * size))
        reading[:, order * size : (order + 1) * size] = readout
    return control.ss(
        dynamics,
        gain,
        reading,
        feedthrough,
        states=[*machine.coordinates, *(f"{name}'" for name in machine.coordinates)],
        inputs=[_signal(str(dof)) for dof in question.inputs],
        outputs=[_signal(str(dof)) for dof in question.outputs],
        name=_signal(machine.name),
    )


def _signal(name: str) -> str:
    """python-control keeps the full stop for itself."""
    return name.replace(".", "_")
