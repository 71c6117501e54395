"""A machine at another pose than that of its nominal rest, in axes that turn with its bodies.

Where stiffness and masses change, a hung or preloaded machine rests elsewhere. Each body then has
turned by R_b and moved. In axes that turn along with the bodies, all that is fixed to a body stays:
its inertia Mb, the rows of its sensors, the columns of its hits. What changes is the Jacobian,
T = R' J, gravity, R_b' g, and the springs: their directions and their tension.

A model at the static equilibrium of its parameters.

Springs, masses and joints decide where a hung or preloaded machine rests. MuJoCo gets their values,
finds the equilibrium, and the machine is linearised there. So a wire that carries a weight keeps
its tension when it is tuned stiffer: it stretches less.
"""

from dataclasses import replace
from typing import TypeVar

import mujoco
import numpy as np

from identification.words import Real
from mbmodel.chain_reduction import reduce_machine
from mbmodel.linearisation.force_slopes import remaining_stiffness_and_damping, soft_inertia
from mbmodel.linearisation.motors import ActuatorGain, actuator_gains
from mbmodel.linearisation.springs import Spring, find_springs
from mbmodel.linearisation.statics import Statics
from mbmodel.linearisation.tendon_slopes import tendon_jacobian
from mbmodel.machine import Machine, Pose
from mbmodel.mjcf.edit import Addition, Edit, NotInMjcf
from mbmodel.parts import BodyPart, JointPart, Part, PartContext, SpringPart
from mbmodel.posed_model import PosedModel


def machine_at_pose(
    machine: Machine, statics: Statics, model: mujoco.MjModel, position: Real
) -> Machine:
    """Return a machine at a pose; coordinates and bodies that the MJCF lacks stay as they are.

    Args:
        machine: at its nominal rest.
        model: compiled, with the parameters that hold at the pose.
        position: joint positions [m, rad]; (nq,).
    """
    data = statics.data_at(model, position)
    if machine.tree is None or (chains := statics.chains_at(model, data)) is None:
        return _tree_at_pose(machine, statics, model, data)[0]
    data = statics.data_at(model, data.qpos)
    tree, other_force = _tree_at_pose(machine.tree, statics, model, data)
    posed = reduce_machine(tree, chains, other_force)
    return replace(_with_posed(machine, posed), pose=_pose_of(machine, statics, data))


def _with_posed(machine: Machine, posed: Machine) -> Machine:
    """Return a machine with all that a pose changes in closed chains; what it has beyond stays.

    Args:
        posed: the machine of the MJCF at the pose, in the same first coordinates and bodies.
    """
    size, count = machine.jacobian.shape

    def fill(whole: Real | None, part: Real | None) -> Real:
        if whole is None or part is None:
            raise ValueError("a machine of closed chains has arrays of all that bends its paths")
        filled: Real = whole.copy()
        filled[tuple(slice(n) for n in part.shape)] = part
        return filled

    def extend(row: Real, length: int) -> Real:
        return np.pad(row, (0, length - len(row)))

    springs = tuple(
        replace(
            spring,
            direction=extend(spring.direction, count),
            geometric=None
            if spring.geometric is None
            else np.pad(spring.geometric, ((0, count - len(spring.geometric)),) * 2),
            at_bodies=None if spring.at_bodies is None else extend(spring.at_bodies, size),
        )
        for spring in posed.springs
    )
    axles = {axle.joint: axle for axle in posed.axles}
    return replace(
        machine,
        jacobian=fill(machine.jacobian, posed.jacobian),
        armature=fill(machine.armature, posed.armature),
        remaining_stiffness=fill(machine.remaining_stiffness, posed.remaining_stiffness),
        remaining_damping=fill(machine.remaining_damping, posed.remaining_damping),
        curvature=fill(machine.curvature, posed.curvature),
        springs=springs,
        axles=tuple(axles.get(axle.joint, axle) for axle in machine.axles),
        motors={
            name: replace(gain, joint=extend(gain.joint, count), body=extend(gain.body, size))
            for name, gain in posed.motors.items()
        },
        statics=None,
    )


def _tree_at_pose(
    machine: Machine, statics: Statics, model: mujoco.MjModel, data: mujoco.MjData
) -> tuple[Machine, Real]:
    """Return a machine without chains at a pose, and its forces beside gravity and springs."""
    pose = _pose_of(machine, statics, data)
    n_body, nv = len(statics.stages), model.nv
    turns, centres = pose.turns[:n_body], tuple(pose.centres[:n_body])
    bodies = np.zeros((6 * n_body, nv))
    for k, stage in enumerate(statics.stages):
        block = bodies[6 * k : 6 * k + 6]
        mujoco.mj_jac(model, data, block[:3], block[3:], centres[k], stage)
    jacobian = machine.jacobian.copy()
    jacobian[: 6 * n_body, :nv] = _turn_back(turns, bodies)
    rows = tendon_jacobian(model, data)
    armature, stiffness, damping = (
        machine.armature.copy(),
        machine.remaining_stiffness.copy(),
        machine.remaining_damping.copy(),
    )
    armature[:nv, :nv] = (
        np.diag(model.dof_armature)
        + rows.T @ (model.tendon_armature[:, None] * rows)
        + soft_inertia(model, data)
    )
    other_force = np.zeros(nv)
    if _has_other_forces(machine, model):
        stiffness[:nv, :nv], damping[:nv, :nv], other_force = remaining_stiffness_and_damping(
            model, data, other_force
        )
    there = actuator_gains(
        model, data, statics.path, list(statics.stages), centres, bodies, only_at_bodies=True
    )[0]
    moved = {name: _drive_at_pose(machine, gain, turns) for name, gain in there.items()}
    springs_there = find_springs(model, data, statics.path, list(statics.stages), centres)
    posed = replace(
        machine,
        jacobian=jacobian,
        armature=armature,
        remaining_stiffness=stiffness,
        remaining_damping=damping,
        springs=_springs_at_pose(machine, springs_there, turns),
        motors={**machine.motors, **moved},
        pose=pose,
        statics=None,
    )
    return posed, other_force


def _pose_of(machine: Machine, statics: Statics, data: mujoco.MjData) -> Pose:
    """Return where the bodies are, those that the MJCF lacks at their nominal rest."""
    stages, n_body = list(statics.stages), len(machine.layout.bodies)
    frames = data.xmat[stages].reshape(-1, 3, 3)
    turns, centres = np.tile(np.eye(3), (n_body, 1, 1)), machine.layout.centres.copy()
    turns[: len(stages)] = frames @ statics.frames.transpose(0, 2, 1)
    centres[: len(stages)] = data.xpos[stages] + np.einsum("bij,bj->bi", frames, statics.centres)
    return Pose(data.qpos.copy(), turns, centres)


def _turn_back(turns: Real, matrix: Real) -> Real:
    """Return rows of body motions or forces in the axes of the turned bodies; (6 n_body, n).

    Args:
        turns: R_b; (n_body, 3, 3).
        matrix: in world axes; (6 n_body, n).
    """
    blocks = matrix.reshape(len(turns), 2, 3, -1)
    return np.einsum("bji,bkjn->bkin", turns, blocks).reshape(matrix.shape)


def _has_other_forces(machine: Machine, model: mujoco.MjModel) -> bool:
    """Return whether something else than gravity and linear springs depends on the pose."""
    polynomials = (
        "jnt_stiffnesspoly",
        "dof_dampingpoly",
        "tendon_stiffnesspoly",
        "tendon_dampingpoly",
    )
    return bool(
        model.nactuator
        or machine.remaining_stiffness.any()
        or machine.remaining_damping.any()
        or any(getattr(model, name).any() for name in polynomials)
    )


def _drive_at_pose(machine: Machine, gain: ActuatorGain, turns: Real) -> ActuatorGain:
    """Return a motor's gain in the axes of the turned bodies, for all coordinates and bodies."""
    nv, size = len(machine.coordinates), len(machine.body_mass)
    body = _turn_back(turns, gain.body[:, None])[:, 0]
    return replace(
        gain,
        joint=np.pad(gain.joint, (0, nv - len(gain.joint))),
        body=np.pad(body, (0, size - len(body))),
    )


def _springs_at_pose(
    machine: Machine, springs_there: tuple[Spring, ...], turns: Real
) -> tuple[Spring, ...]:
    """Return the machine's springs with the directions and tensions of tendons at a pose.

    A tendon that is slack there exerts nothing.
    """
    nv, size = len(machine.coordinates), len(machine.body_mass)
    tendons = {s.name: s for s in springs_there if s.location.startswith("tendon:")}
    springs = []
    for spring in machine.springs:
        posed = tendons.get(spring.name)
        if posed is None:
            springs.append(spring)
            continue
        share = 0.0 if spring.stiffness and not posed.stiffness else 1.0
        count = nv - len(posed.direction)
        bodies = None
        if posed.at_bodies is not None:
            bodies = _turn_back(turns, posed.at_bodies[:, None])[:, 0]
            bodies = share * np.pad(bodies, (0, size - len(bodies)))
        geometric = posed.geometric
        springs.append(
            replace(
                spring,
                direction=share * np.pad(posed.direction, (0, count)),
                geometric=None if geometric is None else np.pad(geometric, ((0, count),) * 2),
                at_bodies=bodies,
            )
        )
    return tuple(springs)


ModelT = TypeVar("ModelT", bound=PosedModel)


def is_static(part: Part) -> bool:
    """Return whether the equilibrium depends on a Part: springs, bodies and joints of the MJCF."""
    return isinstance(part, SpringPart | BodyPart | JointPart)


def static_parameters(model: PosedModel, theta: Real) -> Real:
    """Return the parameters of theta on which the equilibrium depends, one after the other."""
    chosen = [
        values
        for part, values in zip(model.parts, model.split_parameters(theta), strict=True)
        if is_static(part)
    ]
    return np.concatenate([*chosen, np.zeros(0)])


def static_edits(model: PosedModel, theta: Real) -> list[Edit | Addition | NotInMjcf]:
    """Return what static Parts write into the MJCF at theta."""
    return [
        edit
        for part, values in zip(model.parts, model.split_parameters(theta), strict=True)
        if is_static(part)
        for edit in part.write(values)
    ]


def model_at_rest(model: ModelT, theta: Real) -> ModelT:
    """Return a model at its static equilibrium at theta.

    Args:
        model: whose machine has its statics.
        theta: parameters in SI; (n_parameter,).

    Raises:
        ConvergenceError: the machine has no equilibrium there.
    """
    statics = model.machine.statics
    if statics is None:
        return model
    changed = statics.with_edits(static_edits(model, theta))
    return model_at_pose(model, theta, changed, statics.find_pose(changed))


def model_at_pose(model: ModelT, theta: Real, changed: mujoco.MjModel, position: Real) -> ModelT:
    """Return a model at a pose, at rest or not.

    MuJoCo's Jacobian holds what the Parts of joints add to T. It is taken off here, since these
    Parts add it again.

    Args:
        model, theta (n_parameter,): as for ``model_at_rest``.
        changed: the compiled MJCF at theta.
        position: joint positions [m, rad]; (nq,).
    """
    statics = model.machine.statics
    if statics is None:
        return model
    machine = machine_at_pose(model.machine, statics, changed, position)
    size, nv = 6 * len(statics.stages), statics.n_coordinate
    jacobian = machine.jacobian.copy()
    context = PartContext(machine)
    for part, values in zip(model.parts, model.split_parameters(theta), strict=True):
        if isinstance(part, JointPart) and values.any():
            for change in part.changes(values, context):
                added = change.left @ change.core[0] @ change.right.T
                jacobian[:size, :nv] -= added[:size, :nv]
    machine = replace(machine, jacobian=jacobian)
    springs = {spring.name: spring for spring in machine.springs}
    parts = tuple(
        replace(part, springs=tuple(springs[spring.name] for spring in part.springs))
        if isinstance(part, SpringPart)
        else part
        for part in model.parts
    )
    return replace(model, machine=machine, parts=parts)
