"""A rotor in steady rotation: the velocity at which to linearise, and remarks on its limits.

With a hinge turning at a constant rate, the inertia forces are linear in small motions about it:
gyroscopic forces enter the damping, centrifugal ones the stiffness. The equation of a rotor that is
axisymmetric and carries no further joints is constant in time. Any other rotor makes the machine
periodic in time. Its angle is then frozen as drawn, which is an approximation, and a remark says
so.
"""

from collections.abc import Mapping

import mujoco
import numpy as np

from identification.words import Real, UsageError
from mbmodel.mjcf.names import joint_name
from mbmodel.spatial import spatial_inertia, split_inertia

# Relative to the inertia about the axis: below it a rotor counts as axisymmetric.
_MAX_ROTOR_ASYMMETRY = 1e-6


def spin_velocity(model: mujoco.MjModel, spin: Mapping[str, float]) -> Real:
    """Return the velocity of the joint coordinates in steady rotation [rad/s]; (nv,).

    Args:
        spin: rates by the name of the hinge [rad/s].

    Raises:
        UsageError: a joint that is no hinge of the machine, or a rate that is not finite.
    """
    velocity = np.zeros(model.nv)
    for name, rate in spin.items():
        if not np.isfinite(rate):
            raise UsageError(f"joint {name!r} cannot spin at {rate}: give a finite rate in rad/s")
        velocity[model.jnt_dofadr[_hinge(model, name)]] = rate
    return velocity


def _hinge(model: mujoco.MjModel, name: str) -> int:
    """Return the number of a hinge."""
    hinges = {
        joint_name(model, joint): joint
        for joint in range(model.njnt)
        if mujoco.mjtJoint(model.jnt_type[joint]) == mujoco.mjtJoint.mjJNT_HINGE
    }
    if name not in hinges:
        raise UsageError(f"{name!r} is no hinge that could spin: choose one of {', '.join(hinges)}")
    return hinges[name]


def spin_remarks(
    model: mujoco.MjModel, data: mujoco.MjData, spin: Mapping[str, float]
) -> tuple[str, ...]:
    """Return for each spinning joint why the machine is periodic in time, if it is.

    Args:
        spin: rates by the name of the hinge [rad/s].
    """
    remarks = []
    for name, rate in spin.items():
        joint = _hinge(model, name)
        rotor = model.jnt_bodyid[joint]
        bodies = _rotor_bodies(model, rotor)
        reasons = []
        jointed = [b for b in bodies if b != rotor and model.body_jntnum[b]]
        later = [k for k in range(joint + 1, model.njnt) if model.jnt_bodyid[k] == rotor]
        if jointed or later:
            parts = [f"body {model.body(b).name!r}" for b in jointed]
            parts += [f"joint {joint_name(model, k)!r}" for k in later]
            reasons.append(f"it carries {', '.join(parts)}")
        if (asymmetry := _asymmetry(model, data, joint, bodies)) > _MAX_ROTOR_ASYMMETRY:
            reasons.append(f"it is not axisymmetric ({asymmetry:.1%} of its inertia)")
        if rate and reasons:
            remarks.append(
                f"joint {name!r} spins at {rate:g} rad/s and {' and '.join(reasons)}: the machine "
                "is periodic in time, so that its angle is frozen as drawn, as an approximation"
            )
    return tuple(remarks)


def _rotor_bodies(model: mujoco.MjModel, rotor: int) -> list[int]:
    """Return the rotor's body and all bodies that it carries."""
    bodies = {int(rotor)}
    for body in range(rotor + 1, model.nbody):  # parents come first
        if int(model.body_parentid[body]) in bodies:
            bodies.add(body)
    return sorted(bodies)


def _asymmetry(model: mujoco.MjModel, data: mujoco.MjData, joint: int, bodies: list[int]) -> float:
    """Return how far the rotor's inertia changes as it turns, relative to that about the axis."""
    anchor, axis = data.xanchor[joint], data.xaxis[joint]
    total = np.zeros((6, 6))
    for body in bodies:
        axes = data.ximat[body].reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
        total += spatial_inertia(float(model.body_mass[body]), data.xipos[body] - anchor, inertia)
    mass, offset, _ = split_inertia(total)
    about = total[3:, 3:]
    polar = float(axis @ about @ axis)
    across = np.linalg.svd(np.eye(3) - np.outer(axis, axis))[0][:, :2]
    moments = np.linalg.eigvalsh(across.T @ about @ across)
    products = float(np.linalg.norm(about @ axis - polar * axis))
    eccentric = mass * float(np.linalg.norm(offset - axis * (offset @ axis))) ** 2
    return float(max(moments[1] - moments[0], products, eccentric) / polar)
