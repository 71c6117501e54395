"""Let a machine settle where its own masses, places and springs hold it, by MuJoCo itself."""

import copy
from dataclasses import replace

import mujoco
import numpy as np

from truth.machine.mujoco_elements import leads, named_joints, tendon_name, welded_to
from truth.machine.mujoco_forces import balance
from truth.machine.mujoco_reader import CompiledModel, station_of
from truth.machine.springs import Joint, Real
from truth.machine.station import StageBody, Station


def settle(station: Station) -> Station:
    """Return a machine at the equilibrium that its own masses, places and springs give it.

    Sensors and hammer points move with their bodies. A station that its values describe in full
    has no weight, and stays.

    Args:
        station: with the joints and bodies of its source, and any values.

    Raises:
        TruthError: there is no stable equilibrium.
    """
    source = station.source
    if not isinstance(source, CompiledModel):
        return station
    model, data = copy.copy(source.model), copy.copy(source.data)
    welded = welded_to(model)
    for stage, lead in zip(station.stages, leads(model), strict=True):
        _write_body(model, source.data, stage, np.flatnonzero(welded == lead).tolist())
    joints = {joint.name: joint for stage in station.stages for joint in stage.joints}
    for name, number in named_joints(model).items():
        _write_joint(model, source.data, joints[name], number)
    known = {tendon_name(model, number): number for number in range(model.ntendon)}
    for tendon in station.tendons:
        model.tendon_stiffness[known[tendon.name]] = tendon.stiffness
        model.tendon_damping[known[tendon.name]] = tendon.damping
    balance(model, data)
    here = station_of(CompiledModel(model, data, source.files, source.entry), station.name)
    return replace(here, stages=_with_instruments(here, station), loops=station.loops)


def carry(
    place: Real, direction: Real, stage: int, before: Station, after: Station
) -> tuple[Real, Real]:
    """Return a point and a direction that move with a stage from one equilibrium to another."""
    if not (isinstance(before.source, CompiledModel) and isinstance(after.source, CompiledModel)):
        return place, direction
    lead = leads(before.source.model)[stage]
    old, new = before.source.data, after.source.data
    turn = new.xmat[lead].reshape(3, 3) @ old.xmat[lead].reshape(3, 3).T
    return turn @ (place - old.xpos[lead]) + new.xpos[lead], turn @ direction


def _with_instruments(here: Station, station: Station) -> tuple[StageBody, ...]:
    """Return the stages at rest, with the sensors of a station carried there."""
    stages = []
    for index, (stage, drawn) in enumerate(zip(here.stages, station.stages, strict=True)):
        sensors = []
        for sensor in drawn.sensors:
            place, _ = carry(sensor.position, sensor.axes[0], index, station, here)
            axes = [carry(sensor.position, axis, index, station, here)[1] for axis in sensor.axes]
            sensors.append(replace(sensor, position=place, axes=np.array(axes)))
        stages.append(replace(stage, sensors=tuple(sensors)))
    return tuple(stages)


def _write_body(
    model: mujoco.MjModel, data: mujoco.MjData, stage: StageBody, members: list[int]
) -> None:
    """Give the first body of a stage all its mass, and the bodies welded to it none.

    Args:
        model: to be changed.
        data: at the pose in which the stage's values are.
        stage: mass, centre of mass and inertia in world axes.
        members: bodies of the stage, the one that leads it first.
    """
    lead = members[0]
    model.body_mass[members], model.body_inertia[members] = 0.0, 0.0
    frame = data.xmat[lead].reshape(3, 3)
    moments, axes = np.linalg.eigh(frame.T @ stage.inertia @ frame)
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    turn = np.zeros(4)
    mujoco.mju_mat2Quat(turn, axes.ravel())
    model.body_mass[lead], model.body_inertia[lead] = stage.mass, moments
    model.body_ipos[lead] = frame.T @ (stage.com - data.xpos[lead])
    model.body_iquat[lead] = turn
    # Else MuJoCo takes the body's own axes for those of its inertia.
    model.body_sameframe[lead] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE


def _write_joint(model: mujoco.MjModel, data: mujoco.MjData, joint: Joint, number: int) -> None:
    """Give a slide or hinge its place, stiffness and damping.

    Args:
        data: at the pose in which the joint's place is.
        joint: its values.
        number: of the joint in the model.
    """
    frame = data.xmat[model.jnt_bodyid[number]].reshape(3, 3)
    model.jnt_pos[number] += frame.T @ (joint.position - data.xanchor[number])
    model.jnt_stiffness[number] = joint.stiffness
    model.dof_damping[model.jnt_dofadr[number]] = joint.damping
