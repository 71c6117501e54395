"""The linear model as a named state space of python-control."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from identification.words import Real, UsageError
from mbmodel.frf.ports import changed, places
from mbmodel.frf.request import Question
from mbmodel.model import Model

if TYPE_CHECKING:
    import control


def state_space(model: Model, theta: Real, question: Question) -> control.StateSpace:
    """States, inputs and outputs by name; the question's frequencies do not matter.

    x = [q; q'], x' = [[0, 1], [-M^-1 K, -M^-1 C]] x + [0; M^-1 F] u, q the joint coordinates
    (relative to the floor); the outputs are L (T q + z), L (T q' + z') or L (T q'' + U u), z the
    motion of the bodies with the floor, z'' = U u. Accelerance has a direct feed-through; the
    other quantities of a floor that moves have two integrators more for each of its directions.

    Args:
        model: machine and Parts.
        theta: parameters in SI; (n_parameter,).
        question: outputs, inputs and quantity.

    Returns:
        The system, 2 nv states named ``<coordinate>`` and ``<coordinate>'``, then those of the
        floor, ``floor_tx`` and ``floor_tx'``.

    Raises:
        UsageError: a Part that is no polynomial in s acts.
    """
    # With its matplotlib two thirds of a second of every start, which only this needs.
    import control  # noqa: PLC0415

    assembly = model.assemble(theta)
    if assembly.shaped:
        raise UsageError(
            "a Part depends on frequency as no state space of this size does: take it out, or use "
            "FRFs"
        )
    here = places(model.machine, question.outputs, question.inputs)
    here = changed(here, assembly.point_changes, question.outputs, question.inputs)
    drive = assembly.jacobian.T @ (here.force - assembly.body[2] @ here.floor) + here.motor
    names = model.machine.coordinates
    matrices, size, order = assembly.matrices, len(names), question.order
    readout = here.readout @ assembly.jacobian
    accelerations = -np.linalg.solve(
        matrices.mass, np.hstack([matrices.stiffness, matrices.damping, -drive])
    )
    dynamics = np.vstack([np.eye(size, 2 * size, size), accelerations[:, : 2 * size]])
    gain = np.vstack([np.zeros_like(drive), accelerations[:, 2 * size :]])
    states = [*names, *(f"{name}'" for name in names)]
    if order == 2:
        reading = readout @ dynamics[size:]
        feedthrough = readout @ gain[size:] + here.readout @ here.floor
    else:
        reading = np.zeros((len(readout), 2 * size))
        reading[:, order * size : (order + 1) * size] = readout
        feedthrough = np.zeros((len(readout), drive.shape[1]))
        moving = np.flatnonzero(here.floor.any(axis=0))
        states += [f"{question.inputs[k]}{rate}" for rate in ("", "'") for k in moving]
        dynamics, gain = _with_integrators(dynamics, gain, moving)
        carried = here.readout @ here.floor[:, moving]
        parts = [reading, carried, 0 * carried] if order == 0 else [reading, 0 * carried, carried]
        reading = np.hstack(parts)
    return control.ss(
        dynamics,
        gain,
        reading,
        feedthrough,
        states=_signals(states),
        inputs=_signals(map(str, question.inputs)),
        outputs=_signals(map(str, question.outputs)),
        name=_signals([model.machine.name])[0],
    )


def _with_integrators(dynamics: Real, gain: Real, moving: np.ndarray) -> tuple[Real, Real]:
    """Append z and z' of the floor's directions, z'' being their inputs."""
    size, count = len(dynamics), len(moving)
    whole = np.zeros((size + 2 * count, size + 2 * count))
    whole[:size, :size] = dynamics
    whole[size : size + count, size + count :] = np.eye(count)
    driven = np.vstack([gain, np.zeros((2 * count, gain.shape[1]))])
    driven[size + count + np.arange(count), moving] = 1.0
    return whole, driven


def _signals(names: Iterable[str]) -> list[str]:
    """Names without the full stop, which python-control keeps for itself, each once."""
    found: list[str] = []
    for name in names:
        plain = name.replace(".", "_")
        unique, count = plain, 1
        while unique in found:
            count += 1
            unique = f"{plain}_{count}"
        found.append(unique)
    return found
