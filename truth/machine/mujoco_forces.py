"""Forces of a compiled MJCF by MuJoCo itself: where they balance, and their slopes there."""

import copy
from typing import Literal

import mujoco
import numpy as np
import scipy.linalg

from truth.errors import TruthError
from truth.machine.springs import Real

_MAX_BALANCE_STEPS = 200  # of Newton's method at most
_LONGEST_STEP = 0.3  # m or rad
_STEP_HALVINGS = 30
_AT_REST = 1e-11  # of the forces that have to balance
_NEARLY_AT_REST = 1e-6
_WITHOUT_STIFFNESS = 1e-13  # of the largest stiffness over mass
_DIFFERENCE = 1e-4  # m or rad, or their rates: of differences of fourth order
_INSIDE = 0.02  # of the way to the end of a dead band, so that all points stay inside
# Of the values at these multiples of a step, over the step, in a first derivative.
_FOURTH_ORDER = {2.0: -1 / 12, 1.0: 8 / 12, -1.0: -8 / 12, -2.0: 1 / 12}


def balance(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Move a machine to its static equilibrium, downhill from its pose.

    Newton's steps are taken in the modes of the tangent stiffness and the mass, each with the
    absolute value of its stiffness; a step that lessens neither the force nor the energy is halved.

    Args:
        data: the pose at the start; moved in place.

    Raises:
        TruthError: no equilibrium, or one that is not stable.
    """
    force = net_force(model, data)
    scale = _force_scale(model, data)
    for _ in range(_MAX_BALANCE_STEPS):
        if np.abs(force).max(initial=0.0) <= _AT_REST * scale:
            break
        values, shapes = _tangent_modes(model, data)
        pull = shapes.T @ force
        free = np.abs(values) <= _WITHOUT_STIFFNESS * np.abs(values).max(initial=0.0)
        step = shapes @ np.where(free, 0.0, pull / np.where(free, 1.0, np.abs(values)))
        largest = np.abs(step).max(initial=0.0)
        step *= min(1.0, _LONGEST_STEP / max(float(largest), 1e-300))
        start = data.qpos.copy()
        for _ in range(_STEP_HALVINGS):
            data.qpos[:] = start
            mujoco.mj_integratePos(model, data.qpos, step, 1.0)
            ahead = net_force(model, data)
            if (force + ahead) @ step > 0 or np.linalg.norm(ahead) < np.linalg.norm(force):
                break
            step = step / 2
        if np.array_equal(start, data.qpos):
            break
        force = ahead
    if np.abs(force).max(initial=0.0) > _NEARLY_AT_REST * scale:
        raise TruthError("the machine has no static equilibrium: give it stiffness")
    values, _ = _tangent_modes(model, data)
    if values.min(initial=0.0) < -1e-9 * np.abs(values).max(initial=0.0):
        raise TruthError("the machine is not stable at rest: give it stiffness")
    net_force(model, data)


def net_force(model: mujoco.MjModel, data: mujoco.MjData) -> Real:
    """Return the generalised force that vanishes at rest; (nv,)."""
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    mujoco.mj_fwdActuation(model, data)
    return data.qfrc_passive + data.qfrc_actuator - data.qfrc_bias


def force_slopes(
    model: mujoco.MjModel, data: mujoco.MjData, along: Literal["position", "velocity"]
) -> Real:
    """Return stiffness or damping at rest: minus the slopes of MuJoCo's forces; (nv, nv).

    Args:
        along: ``position`` for the stiffness, ``velocity`` for the damping.
    """
    probe, step = copy.copy(data), _difference(model, data) if along == "position" else _DIFFERENCE
    slopes = np.zeros((model.nv, model.nv))
    for column in range(model.nv):
        for times, weight in _FOURTH_ORDER.items():
            change = np.zeros(model.nv)
            change[column] = times * step
            probe.qpos[:], probe.qvel[:] = data.qpos, 0.0
            if along == "position":
                mujoco.mj_integratePos(model, probe.qpos, change, 1.0)
            else:
                probe.qvel[:] = change
            slopes[:, column] -= weight / step * net_force(model, probe)
    return slopes


def full_mass(model: mujoco.MjModel, data: mujoco.MjData) -> Real:
    """Return the mass matrix of the joint coordinates; (nv, nv)."""
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    return mass


def tendon_slopes(model: mujoco.MjModel, data: mujoco.MjData) -> Real:
    """Return the stretch of each tendon per unit of each joint coordinate; (ntendon, nv)."""
    slopes = np.zeros((model.ntendon, model.nv))
    for tendon in range(model.ntendon):
        start, count = int(model.ten_J_rowadr[tendon]), int(model.ten_J_rownnz[tendon])
        columns = model.ten_J_colind[start : start + count]
        slopes[tendon, columns] = data.ten_J[start : start + count]
    return slopes


def _tangent_modes(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Real, Real]:
    slopes = force_slopes(model, data, "position")
    values, shapes = scipy.linalg.eigh((slopes + slopes.T) / 2, full_mass(model, data))
    return np.asarray(values), np.asarray(shapes)


def _force_scale(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Return the size of the forces that have to balance."""
    weight = float(model.body_mass.sum() * np.linalg.norm(model.opt.gravity))
    forces = (data.qfrc_passive, data.qfrc_actuator, data.qfrc_bias)
    return max(weight, *(float(np.abs(force).max(initial=0.0)) for force in forces), 1e-300)


def _difference(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Return a step within which all tendons stay inside or outside their dead bands."""
    steps, slopes = [_DIFFERENCE], tendon_slopes(model, data)
    for tendon in np.flatnonzero(model.tendon_stiffness > 0):
        low, high = model.tendon_lengthspring[tendon]
        reach = float(np.abs(slopes[tendon]).max(initial=0.0))
        length = data.ten_length[tendon]
        away = min(abs(length - low), abs(length - high))
        if high > low and reach > 0 and away > 0:
            steps.append(_INSIDE * away / reach)
    return max(min(steps), 1e-9)
