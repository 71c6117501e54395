"""Loading of a machine from MJCF, linearised at its static equilibrium."""

from collections.abc import Mapping
from pathlib import Path

import mujoco
import numpy as np

from identification.words import InputError, Real
from mbmodel.chain_reduction import reduce_machine, refuse_spinning_chain
from mbmodel.linear_model_check import check_linear_model
from mbmodel.linearisation.chain_closure import soft_remarks
from mbmodel.linearisation.drawing import read_drawing
from mbmodel.linearisation.equilibrium import equilibrium_remarks, find_equilibrium
from mbmodel.linearisation.force_slopes import remaining_stiffness_and_damping, soft_inertia
from mbmodel.linearisation.motors import actuator_gains
from mbmodel.linearisation.points import machine_layout
from mbmodel.linearisation.sensor_rows import RestPose
from mbmodel.linearisation.sensors import read_sensors
from mbmodel.linearisation.spin import spin_remarks, spin_velocity
from mbmodel.linearisation.springs import find_springs
from mbmodel.linearisation.stage_pose import find_posed_chains, move_joints, refuse_return
from mbmodel.linearisation.statics import Statics
from mbmodel.linearisation.tendon_slopes import tendon_jacobian
from mbmodel.machine import Axle, Machine
from mbmodel.mjcf.keyframes import choose_keyframe, keyframe_remarks, pose_data
from mbmodel.mjcf.names import body_name, coordinate_names, joint_name
from mbmodel.mjcf.read import Reading, compile_with_remarks, current_reading
from mbmodel.mjcf.stages import stage_bodies, stage_members, stage_of
from mbmodel.moving_equilibrium.relevance import with_statics
from mbmodel.nonlinear_joints.files import nonlinear_remarks
from mbmodel.parts.spring_laws import read_law_texts
from mbmodel.spatial import spatial_inertia


def load_machine(
    path: Path,
    spin: Mapping[str, float] | None = None,
    key: str | None = None,
    *,
    without_friction: bool = False,
    pose: Mapping[str, float] | None = None,
    follow: bool | None = False,
    reading: Reading | None = None,
) -> Machine:
    """Read an MJCF, find its static equilibrium, and linearise the machine there.

    Bodies without a joint between them count as one stage. Sites on bodies that cannot move are
    left out.

    Args:
        spin: rates of the hinges that turn steadily [rad/s], by name; their angle is frozen.
        key: name of the keyframe that gives the pose and the controls, empty for none; by default
            the keyframe ``home`` if there is one, else none.
        pose: moves of slides and hinges from the drawing or keyframe, each with its springs, by
            name; closed chains follow [m, rad].
        without_friction: whether dry friction (``frictionloss``), which has no linear model, is
            left out instead of refused.
        follow: whether the equilibrium follows the parameters wherever it depends on them; if
            False only where that changes T or K noticeably, if None never.
        reading: as for ``compile_with_remarks``.

    Raises:
        InputError: what cannot be read or linearised, with the element and a remedy.
        ConvergenceError: no static equilibrium.
        UsageError: a spinning joint that is no hinge of the machine.
    """
    reading = reading or current_reading()
    model, compiler_remarks = compile_with_remarks(
        path, without_friction=without_friction, reading=reading
    )
    if not model.nv:
        raise InputError(f"{path}: no body has a joint: give at least one body a joint")
    keyframe = choose_keyframe(model, path, key)
    start = pose_data(model, keyframe)
    posed = move_joints(model, start, pose or {}, path)
    equilibrium = find_equilibrium(model, path, start)
    data, chains = equilibrium.data, equilibrium.chains
    if posed is not None:
        refuse_return(model, posed, data, path)
        chains = find_posed_chains(model, data, posed.following, path)
    stages = stage_bodies(model)
    masses, centres = zip(*(_rigid_body(model, data, stage) for stage in stages), strict=True)
    names = {body_name(model, stage): stage for stage in stages}
    velocity = spin_velocity(model, spin or {})
    stiffness, damping, other_force = remaining_stiffness_and_damping(model, data, velocity)
    jacobian, inertia = _jacobian(model, data, stages, centres), _block_diagonal(masses)
    layout, layout_remarks = machine_layout(model, data, stages, np.array(centres), path)
    motors, motor_remarks = actuator_gains(model, data, path, stages, centres, jacobian)
    machine = Machine(
        name=_model_name(model, path),
        source=path,
        layout=layout,
        coordinates=coordinate_names(model),
        jacobian=jacobian,
        body_mass=inertia,
        armature=_armature(model, data),
        springs=find_springs(model, data, path, stages, centres),
        remaining_stiffness=stiffness,
        remaining_damping=damping,
        gravity=read_gravity(model),
        weight_fraction=_weight_fraction(model, path, stages),
        precedence=_precedence(model),
        axles=_axles(model, data),
        motors=motors,
        drawing=read_drawing(model, data, names, centres),
        spinning=bool(velocity.any()),
        keyframe=keyframe,
        reading=reading,
        remarks=(
            *compiler_remarks,
            *keyframe_remarks(model, keyframe),
            *equilibrium_remarks(model, equilibrium, keyframe),
            *spin_remarks(model, data, spin or {}),
            *(soft_remarks(model, data) if chains is None else chains.remarks()),
            *layout_remarks,
            *motor_remarks,
            *nonlinear_remarks(model),
        ),
        sensors=read_sensors(RestPose(model, data, stages, centres, jacobian, chains), path),
    )
    check_linear_model(model, data, machine, path, velocity)
    machine = read_law_texts(model, machine, path)
    if chains is not None:
        chains.refuse_dead_centre(path)
        refuse_spinning_chain(
            machine, chains, [name for name, rate in (spin or {}).items() if rate]
        )
        machine = reduce_machine(machine, chains, other_force)
    frames = data.xmat[stages].reshape(-1, 3, 3)
    from_origins = np.array(centres) - data.xpos[stages]
    in_frames = np.einsum("bji,bj->bi", frames, from_origins)
    rest = data.qpos.copy()
    if follow is None:
        return machine
    statics = Statics(model, path, keyframe, rest, tuple(stages), frames, in_frames, chains)
    return with_statics(machine, statics, data, always=follow)


def read_gravity(model: mujoco.MjModel) -> Real:
    """Return the acceleration of gravity, zero if it is switched off [m/s^2]; (3,)."""
    off = bool(model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    return np.zeros(3) if off else model.opt.gravity.copy()


def _precedence(model: mujoco.MjModel) -> Real:
    """Return N of the geometric stiffness of gravity; (nv, nv).

    The later of two coordinates is turned by the earlier. The rotations of one ball or free joint
    act at once: to second order each turns the other by half. Coordinates on different branches
    move no common body, so their entries do not matter.
    """
    precedence = np.triu(np.ones((model.nv, model.nv)), 1) + 0.5 * np.eye(model.nv)
    for joint in range(model.njnt):
        dofs = np.flatnonzero(model.dof_jntid == joint)[-3:]
        if len(dofs) == 3:
            precedence[np.ix_(dofs, dofs)] = 0.5
    return precedence


def _weight_fraction(model: mujoco.MjModel, path: Path, stages: list[int]) -> Real:
    """Return 1 - gravcomp of each stage, six times each; (6 n_body,).

    Raises:
        InputError: welded bodies with different ``gravcomp``, or ``gravcomp`` by actuators.
    """
    shares = []
    for stage in stages:
        members = stage_members(model, stage)
        compensated = model.body_gravcomp[members[model.body_mass[members] > 0]]
        if np.ptp(compensated) > 0:
            raise InputError(
                f"{path}: body {body_name(model, stage)!r} and those welded to it differ in "
                "gravcomp: give all of them one value"
            )
        shares.append(1.0 - float(compensated[0]))
    if model.jnt_actgravcomp.any() and model.body_gravcomp.any():
        joint = joint_name(model, int(np.flatnonzero(model.jnt_actgravcomp)[0]))
        raise InputError(
            f'{path}: joint {joint!r} has actuatorgravcomp="true", which is not handled: remove it'
        )
    return np.repeat(shares, 6)


def _axles(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Axle, ...]:
    """Return the slides and hinges, in the order of the joints."""
    kinds = (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE)
    return tuple(
        Axle(
            joint=joint_name(model, joint),
            coordinate=int(model.jnt_dofadr[joint]),
            stage=body_name(model, stage_of(model, model.jnt_bodyid[joint])),
            turns=mujoco.mjtJoint(model.jnt_type[joint]) == mujoco.mjtJoint.mjJNT_HINGE,
            anchor=data.xanchor[joint].copy(),
            axis=data.xaxis[joint].copy(),
        )
        for joint in range(model.njnt)
        if mujoco.mjtJoint(model.jnt_type[joint]) in kinds
    )


def _model_name(model: mujoco.MjModel, path: Path) -> str:
    """Return the name of the MJCF's model, or of its file if it has none."""
    name = model.names.split(b"\0", 1)[0].decode()
    return path.stem if name in ("", "MuJoCo Model") else name


def _rigid_body(model: mujoco.MjModel, data: mujoco.MjData, stage: int) -> tuple[Real, Real]:
    """Return mass matrix and centre of mass of all bodies of a stage together."""
    members = stage_members(model, stage)
    masses = model.body_mass[members]
    centre = masses @ data.xipos[members] / masses.sum()
    total = np.zeros((6, 6))
    for body in members:
        axes = data.ximat[body].reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
        total += spatial_inertia(model.body_mass[body], data.xipos[body] - centre, inertia)
    total[:3, 3:] = total[3:, :3] = 0.0  # rounding: the reference is the centre of mass
    return total, centre


def _block_diagonal(blocks: tuple[Real, ...]) -> Real:
    """Return a matrix with the 6 x 6 blocks on its diagonal."""
    matrix = np.zeros((6 * len(blocks), 6 * len(blocks)))
    for k, block in enumerate(blocks):
        matrix[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] = block
    return matrix


def _jacobian(
    model: mujoco.MjModel, data: mujoco.MjData, stages: list[int], centres: tuple[Real, ...]
) -> Real:
    """Return T at the pose at rest; (6 n_body, nv)."""
    jacobian = np.zeros((6 * len(stages), model.nv))
    for k, (stage, centre) in enumerate(zip(stages, centres, strict=True)):
        block = jacobian[6 * k : 6 * k + 6]
        mujoco.mj_jac(model, data, block[:3], block[3:], centre, stage)
    return jacobian


def _armature(model: mujoco.MjModel, data: mujoco.MjData) -> Real:
    """Return the rotor inertia of joints and tendons, and that of soft constraints; (nv, nv)."""
    rows = tendon_jacobian(model, data)
    armature: Real = np.diag(model.dof_armature) + rows.T @ (model.tendon_armature[:, None] * rows)
    return armature + soft_inertia(model, data)
