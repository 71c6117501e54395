"""Static equilibrium: the search for it, downhill from a pose.

Remarks for the user on the pose at which a machine was linearised.
"""

import copy
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import scipy.linalg

from identification.words import ConvergenceError, InputError, Real, shorten_names
from mbmodel.linearisation.chain_closure import (
    close_chains,
    has_rigid_chains,
    refuse_open_chains,
)
from mbmodel.linearisation.closed_chains import Chains, find_chains
from mbmodel.linearisation.force_slopes import (
    compute_forces,
    force_scale,
    force_slopes,
    net_force,
    symmetrise_rotations,
)
from mbmodel.mjcf.keyframes import DRAWING
from mbmodel.mjcf.names import joint_name
from mbmodel.mjcf.refusals import active_constraint

_MAX_NEWTON_STEPS = 200  # far more than Newton's method needs: it stops at rest
_MAX_STEP_HALVINGS = 30  # a step of 1e-9 of the first that does no work is given up
# Share of the mass that joints move one by one, below which a combination of them has none: the
# factorisation of the mass matrix loses all digits at 1e-16.
_MIN_MASS_SHARE = 1e-13
# Smallest over largest mass of any motion [kg or kg m^2]: below it rounding swallows the smaller.
_MIN_MASS_RATIO = 1e-15
_MAX_STEP = 0.3  # m or rad: beyond it the linear prediction of forces means nothing


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A machine at rest.

    Args:
        data: after ``compute_forces`` at the static equilibrium.
        displacement: of each joint coordinate from the pose at the start [m, rad]; (nv,).
        stable: whether no small displacement meets a force that drives it on.
        chains: closed chains at rest; None without any.
    """

    data: mujoco.MjData
    displacement: Real
    stable: bool
    chains: Chains | None = None


def find_equilibrium(model: mujoco.MjModel, path: Path, start: mujoco.MjData) -> Equilibrium:
    """Find the static equilibrium, downhill from a pose: the drawing or a keyframe.

    At rest the passive and actuator forces balance the bias: r(q) = qfrc_passive + qfrc_actuator
    - qfrc_bias = 0, with r' by central differences. Newton's step is taken in the modes of
    (-r', M) with the absolute value of each stiffness, so that a pendulum drawn upright falls
    instead of climbing. A step is no longer than ``_MAX_STEP`` and is halved until the forces do
    work along it. Directions without stiffness and force stay. A pose that is already at rest
    stays, stable or not.

    Closed chains are closed first. All forces, r', M and steps are then those of the coordinates
    that are kept (``closed_chains``), and each step closes the chains again.

    Args:
        start: the pose, at rest, with the controls that stay.

    Returns:
        The machine at rest.

    Raises:
        InputError: a contact or limit is active there, or a chain that does not close.
        ConvergenceError: forces that no displacement balances, such as those of a free fall.
    """
    data = copy.copy(start)
    if has_rigid_chains(model):
        refuse_open_chains(model, data, close_chains(model, data), path)
    compute_forces(model, data)
    _refuse_locked(model, data, path)
    _refuse_singular_mass(model, data, path)
    scale = force_scale(model, data)
    try:
        _go_to_rest(model, data, scale)
        chains = find_chains(model, data)
        is_stable = _is_stable(model, data, chains)
    except (scipy.linalg.LinAlgError, ValueError) as error:
        raise InputError(
            f"{path}: the search for static equilibrium met a pose without a regular mass matrix "
            "or finite forces: draw the machine nearer to rest, or correct what is out of scale"
        ) from error
    residual = _kept_force(model, data, chains)
    is_balanced = np.abs(residual).max(initial=0.0) <= 1e-6 * scale
    active = active_constraint(model, data)
    if active and (is_balanced or data.ncon):  # a machine that falls meets its limits by chance
        raise InputError(f"{path}: {active}")
    if not is_balanced:
        place = _kept_place(chains, int(np.argmax(np.abs(residual))))
        joint = joint_name(model, model.dof_jntid[place])
        raise ConvergenceError(
            f"{path}: no static equilibrium found, because the force at joint {joint!r} stays "
            "unbalanced: give it stiffness, turn gravity off (--without gravity), or draw the "
            "machine nearer to rest"
        )
    displacement = np.zeros(model.nv)
    mujoco.mj_differentiatePos(model, displacement, 1.0, start.qpos, data.qpos)
    return Equilibrium(data, displacement, is_stable, chains)


def _go_to_rest(model: mujoco.MjModel, data: mujoco.MjData, scale: float) -> None:
    """Move a machine downhill until its forces balance or no step goes on.

    Args:
        data: after ``compute_forces`` at the start; moved in place.
        scale: size of the forces that have to balance.
    """
    for _ in range(_MAX_NEWTON_STEPS):
        chains = find_chains(model, data)
        residual = _kept_force(model, data, chains)
        if np.abs(residual).max(initial=0.0) <= 1e-11 * scale:
            break
        step = _downhill_step(model, data, residual, chains)
        if not _try_step(model, data, residual, step, chains):
            break
        if np.abs(step).max() < 1e-14:
            break


def _kept_force(model: mujoco.MjModel, data: mujoco.MjData, chains: Chains | None) -> Real:
    """Return the force at the coordinates that chains leave, all without any."""
    force = net_force(model, data)
    return force if chains is None else chains.force(force)


def _kept_mass(model: mujoco.MjModel, data: mujoco.MjData, chains: Chains | None) -> Real:
    """Return the mass matrix of the coordinates that chains leave."""
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    return mass if chains is None else chains.matrix(mass)


def _kept_place(chains: Chains | None, number: int) -> int:
    """Return the number of MuJoCo's joint coordinate."""
    return number if chains is None else int(chains.kept[number])


def _refuse_locked(model: mujoco.MjModel, data: mujoco.MjData, path: Path) -> None:
    """Refuse a machine whose closed chains leave no motion."""
    chains = find_chains(model, data)
    if chains is not None and not chains.kept.size:
        raise InputError(
            f"{path}: {shorten_names(chains.constraint_names)} let nothing move: release a joint, "
            "or remove a constraint"
        )


def _refuse_singular_mass(model: mujoco.MjModel, data: mujoco.MjData, path: Path) -> None:
    """Refuse a machine with a motion that moves next to no mass, beside what each joint moves.

    The mass matrix is scaled to a diagonal of ones, so that units do not count. Its smallest
    eigenvalue is the mass of the lightest combination of joints.
    """
    chains = find_chains(model, data)
    mass = _kept_mass(model, data, chains)
    scale = np.sqrt(np.diag(mass))
    if np.isfinite(mass).all() and scale.min(initial=1.0) > 0:
        scaled, unscaled = mass / np.outer(scale, scale), scipy.linalg.eigvalsh(mass)
        smallest = scipy.linalg.eigvalsh(scaled)[0]
        if smallest > _MIN_MASS_SHARE and unscaled[0] > _MIN_MASS_RATIO * unscaled[-1]:
            return
        lightest = scipy.linalg.eigh(scaled)[1][:, 0]
        place = int(np.argmax(np.abs(lightest)))
    else:
        place = int(np.argmin(np.where(np.isfinite(scale), scale, -1.0)))
    joint = joint_name(model, model.dof_jntid[_kept_place(chains, place)])
    raise InputError(
        f"{path}: joint {joint!r} moves together with others without moving any mass: two joints "
        "have nearly one axis, or a length, mass or inertia is out of scale; correct it"
    )


def _tangent_modes(
    model: mujoco.MjModel, data: mujoco.MjData, chains: Chains | None
) -> tuple[Real, Real]:
    """Return stiffnesses and shapes of (-r', M), with rotations of balls symmetrised."""
    stiffness = symmetrise_rotations(model, force_slopes(model, data, along="position")[0])
    if chains is not None:
        stiffness = chains.matrix(stiffness, net_force(model, data))
    mass = _kept_mass(model, data, chains)
    symmetric = (stiffness + stiffness.T) / 2
    try:
        values, shapes = scipy.linalg.eigh(symmetric, mass)
    except scipy.linalg.LinAlgError:  # masses of very different size need a common scale
        scale = 1 / np.sqrt(np.maximum(np.diag(mass), 1e-300))
        both = np.outer(scale, scale)
        values, shapes = scipy.linalg.eigh(symmetric * both, mass * both)
        shapes = scale[:, None] * shapes
    return values, shapes


def _is_stable(model: mujoco.MjModel, data: mujoco.MjData, chains: Chains | None) -> bool:
    """Return whether the tangent stiffness has no eigenvalue below zero, but for rounding."""
    values, _ = _tangent_modes(model, data, chains)
    return not values.size or bool(values[0] >= -1e-9 * max(abs(values[-1]), abs(values[0])))


def _downhill_step(
    model: mujoco.MjModel, data: mujoco.MjData, residual: Real, chains: Chains | None
) -> Real:
    """Return a Newton step that never climbs, at most ``_MAX_STEP`` in any joint; (n,)."""
    values, shapes = _tangent_modes(model, data, chains)
    pull = shapes.T @ residual
    floor = 1e-13 * np.abs(values).max(initial=0.0)
    free = np.abs(values) <= floor
    amount = np.where(free, 0.0, pull / np.where(free, 1.0, np.abs(values)))
    if np.abs(pull[free]).max(initial=0.0) > 1e-9 * np.abs(pull).max():
        amount = np.where(free, np.sign(pull) * _MAX_STEP, amount)
    step: Real = shapes @ amount
    moved = step if chains is None else chains.basis @ step
    return step * min(1.0, _MAX_STEP / max(float(np.abs(moved).max()), 1e-300))


def _try_step(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    residual: Real,
    step: Real,
    chains: Chains | None,
) -> bool:
    """Go along a step, halved until the forces do work on the way; return whether it went."""
    start = data.qpos.copy()
    for _ in range(_MAX_STEP_HALVINGS):
        data.qpos[:] = start
        moved = step if chains is None else chains.basis @ step
        mujoco.mj_integratePos(model, data.qpos, moved, 1.0)
        there = None if chains is None else chains.at(data)
        if chains is None or there is not None:
            compute_forces(model, data)
            force = _kept_force(model, data, there)
            work = (residual + force) @ step
            if work > 0 or np.linalg.norm(force) < np.linalg.norm(residual):
                return True
        step = step / 2
    data.qpos[:] = start
    compute_forces(model, data)
    return False


_MIN_REPORTED_DISPLACEMENT = 1e-3  # m or rad: a smaller displacement needs no remark


def equilibrium_remarks(
    model: mujoco.MjModel, equilibrium: Equilibrium, keyframe: str = DRAWING
) -> tuple[str, ...]:
    """Return how far the machine rests from its drawing, and whether its equilibrium is unstable.

    Args:
        equilibrium: the machine at rest.
        keyframe: name of the keyframe from which it was sought, if any.

    Returns:
        Sentences; empty if there is nothing to say.
    """
    remarks = []
    start = f"keyframe {keyframe!r}" if keyframe else "the drawing"
    if model.nv and np.abs(equilibrium.displacement).max() > _MIN_REPORTED_DISPLACEMENT:
        worst = int(np.argmax(np.abs(equilibrium.displacement)))
        joint = joint_name(model, model.dof_jntid[worst])
        remarks.append(
            f"at static equilibrium joint {joint!r} is displaced by "
            f"{equilibrium.displacement[worst]:.3g} (m or rad) from {start}: positions of "
            "sensors and centres of mass are those at equilibrium"
        )
    if not equilibrium.stable:
        remarks.append(
            "the static equilibrium is unstable: a small displacement grows, and some poles have "
            "positive real parts"
        )
    return tuple(remarks)
