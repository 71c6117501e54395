"""Export of the linear model as a named state space of python-control."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from identification.words import Real, UsageError
from mbmodel.frf.ports import apply_point_changes, find_ports
from mbmodel.frf.request import FrfRequest
from mbmodel.model import Model

if TYPE_CHECKING:
    import control


def state_space(model: Model, theta: Real, request: FrfRequest) -> control.StateSpace:
    """Return the state space with states, inputs and outputs by name.

    x = [q; q'], x' = [[0, 1], [-M^-1 K, -M^-1 C]] x + [0; M^-1 F] u, q the joint coordinates
    (relative to the floor). The outputs are L (T q + z), L (T q' + z') or L (T q'' + U u), with z
    the motion of the bodies with the floor, z'' = U u. Accelerance has a direct feed-through; for
    the other quantities each direction of a moving floor adds two integrators.

    Args:
        model: machine and Parts.
        theta: parameters in SI; (n_parameter,).
        request: outputs, inputs and quantity; its frequencies do not matter.

    Returns:
        The system, 2 nv states named ``<coordinate>`` and ``<coordinate>'``, then those of the
        floor, ``floor_tx`` and ``floor_tx'``.

    Raises:
        UsageError: a Part that is no polynomial in s acts.
    """
    # Imported here: with its matplotlib it would add 0.7 s to every start of the program.
    import control  # noqa: PLC0415

    assembly = model.assemble(theta)
    if assembly.frequency_dependent:
        raise UsageError(
            "a Part is no polynomial in s, so that a state space of this size cannot hold it: "
            "remove the Part, or use FRFs"
        )
    ports = find_ports(model.machine, request.outputs, request.inputs)
    ports = apply_point_changes(ports, assembly.point_changes, request.outputs, request.inputs)
    drive = assembly.jacobian.T @ (ports.force - assembly.body[2] @ ports.floor) + ports.motor
    names = model.machine.coordinates
    matrices, size, order = assembly.matrices, len(names), request.order
    readout = ports.readout @ assembly.jacobian
    accelerations = -np.linalg.solve(
        matrices.mass, np.hstack([matrices.stiffness, matrices.damping, -drive])
    )
    dynamics = np.vstack([np.eye(size, 2 * size, size), accelerations[:, : 2 * size]])
    gain = np.vstack([np.zeros_like(drive), accelerations[:, 2 * size :]])
    states = [*names, *(f"{name}'" for name in names)]
    if order == 2:
        reading = readout @ dynamics[size:]
        feedthrough = readout @ gain[size:] + ports.readout @ ports.floor
    else:
        reading = np.zeros((len(readout), 2 * size))
        reading[:, order * size : (order + 1) * size] = readout
        feedthrough = np.zeros((len(readout), drive.shape[1]))
        moving = np.flatnonzero(ports.floor.any(axis=0))
        states += [f"{request.inputs[k]}{rate}" for rate in ("", "'") for k in moving]
        dynamics, gain = _append_integrators(dynamics, gain, moving)
        floor_readout = ports.readout @ ports.floor[:, moving]
        blocks = (
            [reading, floor_readout, 0 * floor_readout]
            if order == 0
            else [reading, 0 * floor_readout, floor_readout]
        )
        reading = np.hstack(blocks)
    return control.ss(
        dynamics,
        gain,
        reading,
        feedthrough,
        states=_signal_names(states),
        inputs=_signal_names(map(str, request.inputs)),
        outputs=_signal_names(map(str, request.outputs)),
        name=_signal_names([model.machine.name])[0],
    )


def _append_integrators(dynamics: Real, gain: Real, moving: np.ndarray) -> tuple[Real, Real]:
    """Append states z and z' of the floor's directions, with z'' as their inputs."""
    size, count = len(dynamics), len(moving)
    extended = np.zeros((size + 2 * count, size + 2 * count))
    extended[:size, :size] = dynamics
    extended[size : size + count, size + count :] = np.eye(count)
    extended_gain = np.vstack([gain, np.zeros((2 * count, gain.shape[1]))])
    extended_gain[size + count + np.arange(count), moving] = 1.0
    return extended, extended_gain


def _signal_names(names: Iterable[str]) -> list[str]:
    """Return unique names without the full stop, which python-control reserves."""
    unique_names: list[str] = []
    for name in names:
        plain = name.replace(".", "_")
        unique, count = plain, 1
        while unique in unique_names:
            count += 1
            unique = f"{plain}_{count}"
        unique_names.append(unique)
    return unique_names
