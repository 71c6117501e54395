"""A rotor in steady rotation: the velocity at which to linearise, and what that leaves out.

With a hinge turning at a constant rate, the forces of motion are linear in small motions about it:
gyroscopic in the damping, centrifugal in the stiffness. A rotor that is round about its axis and
carries no further joints keeps its equation for ever. Any other makes the machine periodic in
time; its angle is then frozen as drawn, which is an approximation, and said.
"""

from collections.abc import Mapping

import mujoco
import numpy as np

from identification.words import Real, UsageError
from mbmodel.mjcf.read import joint_name
from mbmodel.spatial import spatial_inertia, split_inertia

_ROUND = 1e-6  # deviation from a round rotor, relative to its inertia about the axis


def spin_velocity(model: mujoco.MjModel, spin: Mapping[str, float]) -> Real:
    """Velocity of the joint coordinates in steady rotation [rad/s]; (nv,).

    Raises:
        UsageError: a joint that is no hinge of the machine, or a rate that is no number.
    """
    velocity = np.zeros(model.nv)
    for name, rate in spin.items():
        if not np.isfinite(rate):
            raise UsageError(f"joint {name!r} cannot spin at {rate}: give a rate in rad/s")
        velocity[model.jnt_dofadr[_hinge(model, name)]] = rate
    return velocity


def _hinge(model: mujoco.MjModel, name: str) -> int:
    hinges = {
        joint_name(model, joint): joint
        for joint in range(model.njnt)
        if mujoco.mjtJoint(model.jnt_type[joint]) == mujoco.mjtJoint.mjJNT_HINGE
    }
    if name not in hinges:
        raise UsageError(f"{name!r} is no hinge that could spin: there are {', '.join(hinges)}")
    return hinges[name]


def spin_remarks(
    model: mujoco.MjModel, data: mujoco.MjData, spin: Mapping[str, float]
) -> tuple[str, ...]:
    """Say for each spinning joint why the machine is periodic in time, if it is."""
    remarks = []
    for name, rate in spin.items():
        joint = _hinge(model, name)
        rotor = model.jnt_bodyid[joint]
        carried = _carried(model, rotor)
        reasons = []
        jointed = [b for b in carried if b != rotor and model.body_jntnum[b]]
        later = [k for k in range(joint + 1, model.njnt) if model.jnt_bodyid[k] == rotor]
        if jointed or later:
            what = [f"body {model.body(b).name!r}" for b in jointed]
            what += [f"joint {joint_name(model, k)!r}" for k in later]
            reasons.append(f"it carries {', '.join(what)}")
        if (uneven := _unevenness(model, data, joint, carried)) > _ROUND:
            reasons.append(f"it is not round about its axis ({uneven:.1%} of its inertia)")
        if rate and reasons:
            remarks.append(
                f"joint {name!r} spins at {rate:g} rad/s and {' and '.join(reasons)}: the machine "
                "is periodic in time, its angle is frozen as drawn, which is an approximation"
            )
    return tuple(remarks)


def _carried(model: mujoco.MjModel, rotor: int) -> list[int]:
    """The rotor's body and all that hangs on it."""
    carried = {int(rotor)}
    for body in range(rotor + 1, model.nbody):  # parents come first
        if int(model.body_parentid[body]) in carried:
            carried.add(body)
    return sorted(carried)


def _unevenness(
    model: mujoco.MjModel, data: mujoco.MjData, joint: int, carried: list[int]
) -> float:
    """How far the rotor's inertia changes as it turns, relative to that about the axis."""
    anchor, axis = data.xanchor[joint], data.xaxis[joint]
    total = np.zeros((6, 6))
    for body in carried:
        axes = data.ximat[body].reshape(3, 3)
        own = axes @ np.diag(model.body_inertia[body]) @ axes.T
        total += spatial_inertia(float(model.body_mass[body]), data.xipos[body] - anchor, own)
    mass, offset, _ = split_inertia(total)
    about = total[3:, 3:]
    polar = float(axis @ about @ axis)
    across = np.linalg.svd(np.eye(3) - np.outer(axis, axis))[0][:, :2]
    moments = np.linalg.eigvalsh(across.T @ about @ across)
    products = float(np.linalg.norm(about @ axis - polar * axis))
    eccentric = mass * float(np.linalg.norm(offset - axis * (offset @ axis))) ** 2
    return float(max(moments[1] - moments[0], products, eccentric) / polar)
