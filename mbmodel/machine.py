"""A machine: what the equation of motion needs of an MJCF, at static equilibrium."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from identification.words import InputError, Layout, Real, frozen, is_hammer, node_of
from mbmodel.drawing import Drawing, drawing_of
from mbmodel.equilibrium import (
    elongation,
    remaining_stiffness_and_damping,
    settle,
    tendon_curvature,
    tendon_jacobian,
)
from mbmodel.gravity import gravity_stiffness
from mbmodel.mjcf import compile_mjcf, joint_name
from mbmodel.spatial import spatial_inertia, transport
from mbmodel.spin import spin_remarks, spin_velocity
from mbmodel.tendons import pulls_at_bodies


@dataclass(frozen=True, eq=False)
class Spring:
    """A spring and damper along one direction of the joint coordinates.

    Args:
        name: of the joint or tendon in the MJCF.
        location: ``joint:<child body>`` or ``tendon:<name>``.
        direction: elongation per joint coordinate; (nv,).
        stiffness: [N/m] or [N m/rad].
        damping: [N s/m] or [N m s/rad].
        angular: whether it turns instead of stretching.
        geometric: elongation at rest times the derivative of the direction by the joint
            coordinates, for a tendon under tension: it adds stiffness * geometric; (nv, nv).
        at_bodies: elongation per motion of the centres of mass, for a tendon between sites: with
            T it gives the direction; (6 n_body,).
    """

    name: str
    location: str
    direction: Real
    stiffness: float
    damping: float
    angular: bool
    geometric: Real | None = None
    at_bodies: Real | None = None


@dataclass(frozen=True, eq=False)
class Axle:
    """A slide or hinge at rest, in world axes.

    Args:
        joint: its name.
        coordinate: its number among the joint coordinates.
        stage: name of the body that it carries.
        turns: whether it is a hinge.
        anchor: a point on its axis [m]; (3,).
        axis: unit vector; (3,).
    """

    joint: str
    coordinate: int
    stage: str
    turns: bool
    anchor: Real
    axis: Real


@dataclass(frozen=True, eq=False)
class Machine:
    """Rigid bodies on joints, at static equilibrium, in joint coordinates q.

    Args:
        name: of the model.
        source: its MJCF.
        layout: bodies, sensors and hammer points.
        coordinates: names of the joint coordinates; nv.
        jacobian: T, motion of the centres of mass per joint coordinate; (6 n_body, nv).
        body_mass: Mb, masses and inertias about the centres of mass, world axes [kg, kg m^2];
            (6 n_body, 6 n_body).
        armature: rotor inertia of joints and tendons [kg, kg m^2]; (nv, nv).
        springs: the linear springs and dampers of joints and tendons.
        remaining_stiffness: of actuators, polynomial terms, gravcomp, a spinning rotor; (nv, nv).
        remaining_damping: of actuators, fluids, a spinning rotor; (nv, nv).
        gravity: [m/s^2]; (3,).
        order: 1 where a coordinate comes before another on a chain, a half where neither does;
            (nv, nv), see ``gravity``.
        axles: slides and hinges.
        motors: generalised force per control of each actuator; (nv,) each.
        drawing: where the MJCF's elements stand.
        spinning: whether a hinge turns steadily.
        remarks: what a user must know of this linearisation.
    """

    name: str
    source: Path
    layout: Layout
    coordinates: tuple[str, ...]
    jacobian: Real
    body_mass: Real
    armature: Real
    springs: tuple[Spring, ...]
    remaining_stiffness: Real
    remaining_damping: Real
    gravity: Real
    order: Real
    axles: tuple[Axle, ...]
    motors: Mapping[str, Real]
    drawing: Drawing
    spinning: bool = False
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Validate and freeze."""
        nv, nb = len(self.coordinates), 6 * len(self.layout.bodies)
        for name, shape in {
            "jacobian": (nb, nv),
            "body_mass": (nb, nb),
            "armature": (nv, nv),
            "remaining_stiffness": (nv, nv),
            "remaining_damping": (nv, nv),
            "gravity": (3,),
            "order": (nv, nv),
        }.items():
            object.__setattr__(self, name, frozen(getattr(self, name), np.float64, shape, name))

    @property
    def mass(self) -> Real:
        """T' Mb T + armature: the mass matrix of the joint coordinates; (nv, nv)."""
        mass: Real = self.jacobian.T @ self.body_mass @ self.jacobian + self.armature
        return mass

    @property
    def floor(self) -> Real:
        """Motion of the centres of mass per motion of floor and machine as one; (6 n_body, 6)."""
        return np.concatenate([transport(centre) for centre in self.layout.centres])


def load_machine(path: Path, spin: Mapping[str, float] | None = None) -> Machine:
    """Read an MJCF, let it settle, and take from it what the equation of motion needs.

    Bodies without a joint between them count as one. Sites on bodies that cannot move are left
    out.

    Args:
        path: the MJCF.
        spin: hinges that turn steadily, and at what rate [rad/s]; their angle is frozen.

    Raises:
        InputError: what cannot be read or linearised, with the element and a remedy.
        ConvergenceError: no static equilibrium.
        UsageError: a spinning joint that is no hinge of the machine.
    """
    model = compile_mjcf(path)
    if not model.nv:
        raise InputError(f"{path}: no body has a joint: a machine needs something that moves")
    data = settle(model, path)
    stages = [b for b in range(1, model.nbody) if model.body_weldid[b] == b]
    masses, centres = zip(*(_rigid_body(model, data, stage) for stage in stages), strict=True)
    names = {_body_name(model, stage): stage for stage in stages}
    velocity = spin_velocity(model, spin or {})
    stiffness, damping = remaining_stiffness_and_damping(model, data, velocity)
    jacobian, inertia = _jacobian(model, data, stages, centres), _block_diagonal(masses)
    order = _order(model)
    stiffness += _gravity_compensation(model, data, stages, centres, jacobian, order)
    return Machine(
        name=_model_name(model, path),
        source=path,
        layout=_layout(model, data, stages, np.array(centres), path),
        coordinates=_coordinate_names(model),
        jacobian=jacobian,
        body_mass=inertia,
        armature=_armature(model, data),
        springs=_springs(model, data, path, stages, centres),
        remaining_stiffness=stiffness,
        remaining_damping=damping,
        gravity=_gravity(model),
        order=order,
        axles=_axles(model, data),
        motors=_motors(model, data),
        drawing=drawing_of(model, data, names, centres),
        spinning=bool(velocity.any()),
        remarks=spin_remarks(model, data, spin or {}),
    )


def _gravity(model: mujoco.MjModel) -> Real:
    off = bool(model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    gravity: Real = np.zeros(3) if off else model.opt.gravity.copy()
    return gravity


def _order(model: mujoco.MjModel) -> Real:
    """N of ``gravity``: the later of two coordinates is turned by the earlier.

    The rotations of one ball or free joint act at once: to second order each turns the other by
    half. Coordinates on different branches meet in no body, so their place does not matter.
    """
    order = np.triu(np.ones((model.nv, model.nv)), 1) + 0.5 * np.eye(model.nv)
    for joint in range(model.njnt):
        dofs = np.flatnonzero(model.dof_jntid == joint)[-3:]
        if len(dofs) == 3:
            order[np.ix_(dofs, dofs)] = 0.5
    return order


def _gravity_compensation(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    stages: list[int],
    centres: tuple[Real, ...],
    jacobian: Real,
    order: Real,
) -> Real:
    """Geometric stiffness of the upward forces of ``gravcomp``; (nv, nv)."""
    lifted = np.zeros((len(jacobian), len(jacobian)))
    for k, (stage, centre) in enumerate(zip(stages, centres, strict=True)):
        for body in np.flatnonzero(model.body_weldid == stage):
            lift = float(model.body_mass[body] * model.body_gravcomp[body])
            lifted[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] -= spatial_inertia(
                lift, data.xipos[body] - centre, np.zeros((3, 3))
            )
    if not lifted.any():
        return np.zeros((model.nv, model.nv))
    return gravity_stiffness(_gravity(model), order, jacobian, lifted)


def _axles(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Axle, ...]:
    kinds = (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE)
    return tuple(
        Axle(
            joint=joint_name(model, joint),
            coordinate=int(model.jnt_dofadr[joint]),
            stage=_body_name(model, model.body_weldid[model.jnt_bodyid[joint]]),
            turns=mujoco.mjtJoint(model.jnt_type[joint]) == mujoco.mjtJoint.mjJNT_HINGE,
            anchor=data.xanchor[joint].copy(),
            axis=data.xaxis[joint].copy(),
        )
        for joint in range(model.njnt)
        if mujoco.mjtJoint(model.jnt_type[joint]) in kinds
    )


def _motors(model: mujoco.MjModel, data: mujoco.MjData) -> dict[str, Real]:
    """Generalised force of each actuator per unit of its control, which is linear in it."""
    probe = mujoco.MjData(model)
    probe.qpos[:] = data.qpos
    limits = model.opt.disableflags
    columns = {}
    try:
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL
        for actuator in range(model.nu):
            forces = []
            for control in (1.0, 0.0):
                probe.ctrl[:] = data.ctrl
                probe.ctrl[actuator] += control
                mujoco.mj_forward(model, probe)
                forces.append(probe.qfrc_actuator.copy())
            columns[model.actuator(actuator).name or f"actuator{actuator}"] = forces[0] - forces[1]
    finally:
        model.opt.disableflags = limits
    return columns


def _model_name(model: mujoco.MjModel, path: Path) -> str:
    name = model.names.split(b"\0", 1)[0].decode()
    return path.stem if name in ("", "MuJoCo Model") else name


def _rigid_body(model: mujoco.MjModel, data: mujoco.MjData, stage: int) -> tuple[Real, Real]:
    """Mass matrix about the centre of mass, and that centre, of all bodies welded to a stage."""
    members = np.flatnonzero(model.body_weldid == stage)
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
    matrix = np.zeros((6 * len(blocks), 6 * len(blocks)))
    for k, block in enumerate(blocks):
        matrix[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] = block
    return matrix


def _jacobian(
    model: mujoco.MjModel, data: mujoco.MjData, stages: list[int], centres: tuple[Real, ...]
) -> Real:
    jacobian = np.zeros((6 * len(stages), model.nv))
    for k, (stage, centre) in enumerate(zip(stages, centres, strict=True)):
        block = jacobian[6 * k : 6 * k + 6]
        mujoco.mj_jac(model, data, block[:3], block[3:], centre, stage)
    return jacobian


def _layout(
    model: mujoco.MjModel, data: mujoco.MjData, stages: list[int], centres: Real, path: Path
) -> Layout:
    sites = [s for s in range(model.nsite) if model.body_weldid[model.site_bodyid[s]] in stages]
    names = [model.site(s).name or f"site{s}" for s in sites]
    _refuse_shared_nodes(path, names)
    try:
        return Layout(
            bodies=tuple(_body_name(model, stage) for stage in stages),
            centres=centres,
            points=tuple(names),
            body_of=np.array(
                [stages.index(model.body_weldid[model.site_bodyid[s]]) for s in sites], np.intp
            ),
            positions=data.site_xpos[sites].reshape(-1, 3),
            axes=data.site_xmat[sites].reshape(-1, 3, 3),
        )
    except ValueError as error:
        raise InputError(f"{path}: {error}: rename one of them") from error


def _refuse_shared_nodes(path: Path, names: list[str]) -> None:
    seen: dict[tuple[int, bool], str] = {}
    for name in names:
        if (node := node_of(name)) is not None:
            first = seen.setdefault((node, is_hammer(name)), name)
            if first != name:
                raise InputError(
                    f"{path}: sites {first!r} and {name!r} both end in node {node}: renumber one"
                )


def _body_name(model: mujoco.MjModel, body: int) -> str:
    return str(model.body(body).name) or f"body{body}"


def _coordinate_names(model: mujoco.MjModel) -> tuple[str, ...]:
    names = [joint_name(model, joint) for joint in model.dof_jntid]
    count = {name: names.count(name) for name in names}
    start = {name: names.index(name) for name in names}
    return tuple(
        name if count[name] == 1 else f"{name}.{k - start[name]}" for k, name in enumerate(names)
    )


def _armature(model: mujoco.MjModel, data: mujoco.MjData) -> Real:
    rows = tendon_jacobian(model, data)
    armature: Real = np.diag(model.dof_armature) + rows.T @ (model.tendon_armature[:, None] * rows)
    return armature


def _springs(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    path: Path,
    stages: list[int],
    centres: tuple[Real, ...],
) -> tuple[Spring, ...]:
    pulls = pulls_at_bodies(model, data, stages, centres)
    springs = _joint_springs(model) + _tendon_springs(model, data, pulls)
    names = [spring.name for spring in springs]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{path}: a tendon and a joint are both named {name!r}: rename one")
    return springs


def _joint_springs(model: mujoco.MjModel) -> tuple[Spring, ...]:
    """One spring for each slide and hinge; each coordinate of a ball or free joint has a damper."""
    springs = []
    names = _coordinate_names(model)
    for dof in range(model.nv):
        joint = model.dof_jntid[dof]
        kind = mujoco.mjtJoint(model.jnt_type[joint])
        single = kind in (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE)
        translating_free = kind == mujoco.mjtJoint.mjJNT_FREE and dof - model.jnt_dofadr[joint] < 3
        stage = model.body_weldid[model.dof_bodyid[dof]]
        springs.append(
            Spring(
                name=names[dof],
                location=f"joint:{_body_name(model, stage)}",
                direction=np.eye(model.nv)[dof],
                stiffness=float(model.jnt_stiffness[joint]) if single else 0.0,
                damping=float(model.dof_damping[dof]),
                angular=kind != mujoco.mjtJoint.mjJNT_SLIDE and not translating_free,
            )
        )
    return tuple(springs)


def _tendon_springs(
    model: mujoco.MjModel, data: mujoco.MjData, pulls: Mapping[int, Real]
) -> tuple[Spring, ...]:
    rows = tendon_jacobian(model, data)
    slack = (model.tendon_lengthspring[:, 0] < data.ten_length) & (
        data.ten_length < model.tendon_lengthspring[:, 1]
    )
    length, curvature = elongation(model, data), tendon_curvature(model, data)
    springs = []
    for tendon in range(model.ntendon):
        name = model.tendon(tendon).name or f"tendon{tendon}"
        springs.append(
            Spring(
                name=name,
                location=f"tendon:{name}",
                direction=rows[tendon],
                stiffness=0.0 if slack[tendon] else float(model.tendon_stiffness[tendon]),
                damping=float(model.tendon_damping[tendon]),
                angular=False,
                geometric=curvature[tendon] * length[tendon] if length[tendon] else None,
                at_bodies=pulls.get(tendon),
            )
        )
    return tuple(springs)
