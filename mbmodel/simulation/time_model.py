"""A machine ready for integration in time: MuJoCo's model with probes, at static equilibrium.

A probe is a point that is fixed to a stage. MuJoCo reports its velocity, or its place, at every
step, so that no Python code runs between steps.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from identification.words import Integers, Real, UsageError
from mbmodel.linearisation.equilibrium import find_equilibrium
from mbmodel.linearisation.force_slopes import compute_forces, net_force
from mbmodel.linearisation.spin import spin_velocity
from mbmodel.machine import Machine
from mbmodel.mjcf.keyframes import pose_data
from mbmodel.mjcf.read import compile_with_remarks
from mbmodel.mjcf.stages import stage_bodies

PROBE_CHANNELS = 6  # along x y z and about x y z, in world axes
_PREFIX = "mbw probe"  # of the names of sites and sensors that are added
_SENSOR_TYPE = mujoco.mjtSensor
# What a probe reads, by the number of differentiations of the motion.
_SENSORS_OF_ORDER = {
    0: (_SENSOR_TYPE.mjSENS_FRAMEPOS, _SENSOR_TYPE.mjSENS_FRAMEQUAT),
    1: (_SENSOR_TYPE.mjSENS_FRAMELINVEL, _SENSOR_TYPE.mjSENS_FRAMEANGVEL),
    2: (_SENSOR_TYPE.mjSENS_FRAMELINVEL, _SENSOR_TYPE.mjSENS_FRAMEANGVEL),
}
FULL_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS


@dataclass(frozen=True, eq=False)
class Probe:
    """A point that moves with a stage.

    Args:
        stage: name of the stage.
        position: at rest, in world axes [m]; (3,).
    """

    stage: str
    position: Real


@dataclass(frozen=True, eq=False)
class TimeModel:
    """A machine with its probes, at static equilibrium.

    Args:
        machine: the machine, for labels and its linear model.
        compiled: MuJoCo's model, with the probes' sensors.
        start: MuJoCo's full physics state at rest; (n_state,).
        controls: of the actuators at rest; (n_control,).
        holding: generalised forces that keep a spinning rotor at its rate; (nv,).
        centres: place of each MJCF body's centre of mass at rest [m]; (n_body, 3).
        lead: number of the MJCF body that leads each stage; n_stage.
        order: number of differentiations of the motion that the probes read: 0, 1, 2.
        probe_columns: columns of MuJoCo's sensor data; (n_probe, 7 or 6).
        encoder_columns: columns of MuJoCo's sensor data, one for each joint and each number of a
            sensor of the MJCF; n_encoder.
        rest: sensor data at rest; (n_sensor,).
    """

    machine: Machine
    compiled: mujoco.MjModel
    start: Real
    controls: Real
    holding: Real
    centres: Real
    lead: Integers
    order: int
    probe_columns: Integers
    encoder_columns: Integers
    rest: Real


def build_time_model(
    machine: Machine,
    probes: Sequence[Probe],
    encoders: Sequence[str] = (),
    *,
    sensors: Sequence[tuple[str, int]] = (),
    order: int = 2,
    spin: Mapping[str, float] | None = None,
    change: Callable[[mujoco.MjSpec], None] = lambda spec: None,
) -> TimeModel:
    """Compile a machine's MJCF with probes, and bring it to static equilibrium.

    Dry friction is left out in the search for equilibrium, and acts from then on.

    Args:
        probes: points whose motion is read.
        encoders: joints whose position is read, relative to rest.
        sensors: MuJoCo sensors of the MJCF, by name and number, that are read relative to rest.
        order: number of differentiations of the motion that the probes read: 0, 1, 2.
        spin: rates of the hinges that turn steadily [rad/s], by name.
        change: adds further sensors.

    Raises:
        InputError: the MJCF cannot be read any more.
        UsageError: there is no such joint or sensor, or it is neither a slide nor a hinge.
    """
    flags: list[int] = []

    def add_sensors(spec: mujoco.MjSpec) -> None:
        flags.append(int(spec.option.disableflags))
        add_probes(spec, machine, probes, _PREFIX, _SENSORS_OF_ORDER[order])
        _add_encoders(spec, encoders)
        change(spec)

    compiled, _ = compile_with_remarks(
        machine.source, without_friction=True, reading=machine.reading, change=add_sensors
    )
    data = find_equilibrium(compiled, machine.source, pose_data(compiled, machine.keyframe)).data
    compiled.opt.disableflags = flags[0] | machine.reading.disabled
    velocity = spin_velocity(compiled, spin or {})
    data.qvel[:] = velocity
    compute_forces(compiled, data)
    holding = -net_force(compiled, data) if velocity.any() else np.zeros(compiled.nv)
    data.qfrc_applied[:] = holding
    mujoco.mj_forward(compiled, data)  # all sensors at rest
    start = np.zeros(mujoco.mj_stateSize(compiled, FULL_STATE))
    mujoco.mj_getState(compiled, data, start, FULL_STATE)
    widths = [_width(kind) for kind in _SENSORS_OF_ORDER[order]]
    return TimeModel(
        machine,
        compiled,
        start,
        data.ctrl.copy(),
        holding,
        data.xipos.copy(),
        np.array(stage_bodies(compiled), np.intp),
        order,
        np.array(
            [
                sensor_data_columns(
                    compiled, [f"{_PREFIX} {k} {part}" for part in range(len(widths))]
                )
                for k in range(len(probes))
            ],
            np.intp,
        ).reshape(len(probes), sum(widths)),
        np.concatenate(
            [
                sensor_data_columns(
                    compiled, [f"{_PREFIX} joint {k}" for k in range(len(encoders))]
                ),
                sensor_value_columns(compiled, sensors),
            ]
        ),
        data.sensordata.copy(),
    )


def _width(kind: mujoco.mjtSensor) -> int:
    return 4 if kind == _SENSOR_TYPE.mjSENS_FRAMEQUAT else 3


def sensor_data_columns(compiled: mujoco.MjModel, names: Sequence[str]) -> Integers:
    """Return the columns of sensor data of some sensors, one after the other."""
    spans = [
        range(int(compiled.sensor(name).adr[0]), int(compiled.sensor(name).adr[0] + count))
        for name in names
        for count in compiled.sensor(name).dim
    ]
    return np.array([column for span in spans for column in span], np.intp)


def sensor_value_columns(compiled: mujoco.MjModel, sensors: Sequence[tuple[str, int]]) -> Integers:
    """Return the columns of numbers of the MJCF's own sensors."""
    names = [compiled.sensor(k).name for k in range(compiled.nsensor)]
    named = [name for name in names if name and not name.startswith(_PREFIX)]
    columns = []
    for name, number in sensors:
        if name not in named:
            raise UsageError(
                f"{name!r} is neither a label such as acc11:+tx nor a sensor of the model: its "
                f"sensors are {', '.join(named) or 'none'}"
            )
        sensor = compiled.sensor(name)
        if number >= int(sensor.dim[0]):
            raise UsageError(
                f"sensor {name!r} has {int(sensor.dim[0])} numbers: there is no {name}.{number}"
            )
        columns.append(int(sensor.adr[0]) + number)
    return np.array(columns, np.intp)


def add_probes(
    spec: mujoco.MjSpec,
    machine: Machine,
    probes: Sequence[Probe],
    prefix: str,
    kinds: Sequence[mujoco.mjtSensor],
) -> None:
    """Add a site in world axes, and its sensors of some kinds, for each probe.

    Args:
        prefix: of their names: ``<prefix> <number of the probe> <number of the kind>``.
        kinds: of the sensors.
    """
    # MuJoCo numbers bodies in the order of the file, so names that it lacks follow from it.
    bodies = {body.name or f"body{number}": body for number, body in enumerate(spec.bodies)}
    for number, probe in enumerate(probes):
        drawn = machine.drawing.bodies[probe.stage]
        if probe.stage not in bodies:
            raise UsageError(f"body {probe.stage!r} has no name in the MJCF: name it")
        turn = np.zeros(4)
        mujoco.mju_mat2Quat(turn, np.ascontiguousarray(drawn.frame.T).ravel())
        name = f"{prefix} {number}"
        bodies[probe.stage].add_site(
            name=name, pos=drawn.frame.T @ (probe.position - drawn.origin), quat=turn
        )
        for part, kind in enumerate(kinds):
            spec.add_sensor(
                name=f"{name} {part}",
                type=kind,
                objtype=mujoco.mjtObj.mjOBJ_SITE,
                objname=name,
            )


def _add_encoders(spec: mujoco.MjSpec, encoders: Sequence[str]) -> None:
    """Add a sensor of the position of each joint."""
    kinds = {joint.name: joint.type for joint in spec.joints}
    single = (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE)
    for number, name in enumerate(encoders):
        if kinds.get(name) not in single:
            choice = ", ".join(joint for joint, kind in kinds.items() if kind in single and joint)
            raise UsageError(
                f"{name!r} is no slide or hinge of the model: choose one of {choice or 'none'}"
            )
        spec.add_sensor(
            name=f"{_PREFIX} joint {number}",
            type=_SENSOR_TYPE.mjSENS_JOINTPOS,
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            objname=name,
        )
