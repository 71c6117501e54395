r"""MuJoCo's sensors as outputs of the linear model: what each reads per motion, force and control.

    y = s^k (L b + J q) + (C_0 + s C_1 + s^2 C_2) q + E w + D u

b is the motion of the bodies' centres of mass, q that of the joints, w wrenches at the centres, u
the controls. L and J are known in closed form for sensors of position, velocity and acceleration
(``sensor_rows``), so that they follow when joints move. Differences of MuJoCo's own readings check
them. What these show beyond L and J is in C, E and D: the weight that a tilting accelerometer
feels, and the forces of force sensors and actuators, for which L and J are zero.

The reactions of closed chains are readings of this last kind: with r the force that all accelerated
masses, springs and inputs leave at the joints, C' l = -r (``closed_chains``). Differences are taken
along the coordinates that the chains leave.
"""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self

import mujoco
import numpy as np

from identification.words import JOINT_PREFIX, InputError, Real
from mbmodel.linearisation.motors import change_command
from mbmodel.linearisation.sensor_rows import RestPose, SensorRows, closed_form_rows
from mbmodel.mjcf.names import actuator_name, coordinate_names

_SENSOR_KIND = mujoco.mjtSensor
# Kinds whose readings are linear in small motions, forces and controls, without a closed form.
_BY_DIFFERENCES = {
    _SENSOR_KIND.mjSENS_FORCE: "N",
    _SENSOR_KIND.mjSENS_TORQUE: "N m",
    _SENSOR_KIND.mjSENS_ACTUATORFRC: "N",
    _SENSOR_KIND.mjSENS_JOINTACTFRC: "N",
    _SENSOR_KIND.mjSENS_TENDONACTFRC: "N",
    _SENSOR_KIND.mjSENS_FRAMEQUAT: "1",
    _SENSOR_KIND.mjSENS_MAGNETOMETER: "1",
    _SENSOR_KIND.mjSENS_SUBTREECOM: "m",
    _SENSOR_KIND.mjSENS_SUBTREELINVEL: "m/s",
}
_RATES = ("", "/s", "/s²")
_TURNING = {
    _SENSOR_KIND.mjSENS_GYRO,
    _SENSOR_KIND.mjSENS_FRAMEANGVEL,
    _SENSOR_KIND.mjSENS_FRAMEANGACC,
}
_UNITLESS = {
    _SENSOR_KIND.mjSENS_FRAMEXAXIS,
    _SENSOR_KIND.mjSENS_FRAMEYAXIS,
    _SENSOR_KIND.mjSENS_FRAMEZAXIS,
}
# Only an accelerometer may read more than its rows: the weight, when it tilts.
_TILTING = {_SENSOR_KIND.mjSENS_ACCELEROMETER}
_STEPS = (1e-6, 1e-4, 1.0)  # m, m/s, m/s^2 or rad: of differences; readings are linear in the last
_MAX_ROW_ERROR = 1e-6  # of the closed form against differences, relative to the largest entry


@dataclass(frozen=True, eq=False)
class SensorReading:
    """One number of a MuJoCo sensor as an output of the linear model.

    Args:
        unit: of the reading, such as ``m/s²``.
        order: k, 0, 1, 2 for a reading of position, velocity or acceleration.
        body: L, per motion of the centres of mass; (6 n_body,).
        joint: J, per joint coordinate; (nv,).
        motion: C, per s^0, s^1, s^2 of the joint coordinates; (3, nv).
        wrench: E, per wrench at the centres of mass; (6 n_body,).
        controls: D, per control, by the name of the motor; of reactions also per force at a joint.
    """

    unit: str
    order: int
    body: Real
    joint: Real
    motion: Real
    wrench: Real
    controls: Mapping[str, float] = field(default_factory=dict)

    def extend(self, coordinates: int, bodies: int) -> Self:
        """Return the reading of a machine with more coordinates and bodies, which it lacks.

        Args:
            coordinates: number of further joint coordinates.
            bodies: number of further bodies.
        """
        return replace(
            self,
            body=np.pad(self.body, (0, 6 * bodies)),
            joint=np.pad(self.joint, (0, coordinates)),
            motion=np.pad(self.motion, ((0, 0), (0, coordinates))),
            wrench=np.pad(self.wrench, (0, 6 * bodies)),
        )

    @property
    def has_further_terms(self) -> bool:
        """Whether it reads more than one derivative of the motion: C, E or D are not zero."""
        return bool(self.motion.any() or self.wrench.any() or any(self.controls.values()))


@dataclass(frozen=True, eq=False)
class MujocoSensors:
    """The MuJoCo sensors of a machine.

    Args:
        readings: those with a linear model, by name; the number k > 0 of a sensor is ``name.k``.
        refused: why others have none, by name.
    """

    readings: Mapping[str, SensorReading] = field(default_factory=dict)
    refused: Mapping[str, str] = field(default_factory=dict)

    def extend(self, coordinates: int = 0, bodies: int = 0) -> Self:
        """Return the sensors of a machine with more coordinates and bodies, which they lack."""
        readings = {
            name: reading.extend(coordinates, bodies) for name, reading in self.readings.items()
        }
        return replace(self, readings=readings)


def read_sensors(pose: RestPose, path: Path) -> MujocoSensors:
    """Return the readings of all MuJoCo sensors of a machine at rest.

    Raises:
        InputError: two numbers of sensors with one name.
    """
    model = pose.model
    if not model.nsensor and pose.chains is None:
        return MujocoSensors()
    slopes, names = _reading_slopes(pose), [*_control_names(model), *_joint_ports(model)]
    readings: dict[str, SensorReading] = {}
    refused: dict[str, str] = {}
    for sensor in range(model.nsensor):
        name = model.sensor(sensor).name or f"sensor{sensor}"
        start, dim = int(model.sensor_adr[sensor]), int(model.sensor_dim[sensor])
        rows, reason = _rows_of(pose, sensor, slopes)
        for number in range(dim):
            port = name if number == 0 else f"{name}.{number}"
            if port in readings or port in refused:
                raise InputError(f"{path}: two sensors are called {port!r}: rename one")
            if rows is None:
                refused[port] = reason
            else:
                at = slopes.at(start + number)
                readings[port] = _reading(pose, sensor, rows, number, at, names)
    if pose.chains is not None:
        for number, (port, unit) in enumerate(pose.chains.reaction_names):
            if port in readings or port in refused:
                raise InputError(f"{path}: a sensor is called {port!r}, as a reaction: rename it")
            at = slopes.at(model.nsensordata + number)
            readings[port] = _reaction(pose, unit, at, names)
    return MujocoSensors(readings, refused)


def _reaction(pose: RestPose, unit: str, slopes: "_Slopes", names: Sequence[str]) -> SensorReading:
    """Return one reaction of a closed chain as a reading."""
    body, joint = pose.empty(1)
    control = dict(zip(names, slopes.control.tolist(), strict=True))
    row = joint[0] @ pose.basis
    return SensorReading(unit, 0, body[0], row, slopes.motion, slopes.wrench, control)


@dataclass(frozen=True, eq=False)
class _Slopes:
    """Derivatives of all readings, from differences of MuJoCo's.

    Args:
        motion: by position, velocity, acceleration of the joint coordinates; (3, n_reading, nv).
        wrench: by wrenches at the centres of mass; (n_reading, 6 n_body).
        control: by controls, and with closed chains by forces at all joint coordinates;
            (n_reading, n).
    """

    motion: Real
    wrench: Real
    control: Real

    def at(self, rows: slice | int) -> "_Slopes":
        """Return the derivatives of some readings."""
        return _Slopes(self.motion[:, rows], self.wrench[rows], self.control[rows])


def _rows_of(pose: RestPose, sensor: int, slopes: _Slopes) -> tuple[SensorRows | None, str]:
    """Return the rows of a sensor, or None and why it has none."""
    model = pose.model
    kind = _SENSOR_KIND(model.sensor_type[sensor])
    word = kind.name.removeprefix("mjSENS_").lower()
    dim = int(model.sensor_dim[sensor])
    if model.sensor_delay[sensor] > 0 or model.sensor_interval[sensor].any():
        return None, "its readings are delayed or sampled: remove delay and interval"
    rows = closed_form_rows(pose, sensor)
    if rows is None:
        if kind not in _BY_DIFFERENCES:
            return None, f"a sensor of the kind {word} has no linear model: read a motion or force"
        return SensorRows(0, *pose.empty(dim)), ""
    start = int(model.sensor_adr[sensor])
    differences = slopes.at(slice(start, start + dim))
    closed_form = (rows.body @ pose.jacobian + rows.joint) @ pose.basis
    error = differences.motion[rows.order] - closed_form
    scale = max(np.abs(rows.body).max(initial=0.0), np.abs(rows.joint).max(initial=0.0))
    if np.abs(error).max() > _MAX_ROW_ERROR * max(scale, 1e-300):
        return None, "its reading at rest is at its cutoff, where it does not follow: widen cutoff"
    return rows, ""


def _reading(  # one for each thing known of a reading
    pose: RestPose,
    sensor: int,
    rows: SensorRows,
    number: int,
    slopes: _Slopes,
    names: Sequence[str],
) -> SensorReading:
    """Return one number of a sensor; what differences show beyond its rows are further terms."""
    kind = _SENSOR_KIND(pose.model.sensor_type[sensor])
    motion, wrench, control = slopes.motion.copy(), slopes.wrench, slopes.control
    joint = rows.joint[number] @ pose.basis
    motion[rows.order] -= rows.body[number] @ pose.jacobian @ pose.basis + joint
    if kind in _BY_DIFFERENCES or kind in _TILTING:
        scale = np.abs(slopes.motion).max(axis=1, keepdims=True)
        motion = np.where(np.abs(motion) > _MAX_ROW_ERROR * scale, motion, 0.0)
    else:
        motion, wrench, control = 0 * motion, 0 * wrench, 0 * control
    return SensorReading(
        _unit(pose.model, sensor, rows.order),
        rows.order,
        rows.body[number],
        joint,
        motion,
        wrench,
        dict(zip(names[: len(pose.data.ctrl)], control.tolist(), strict=False)),
    )


def _unit(model: mujoco.MjModel, sensor: int, order: int) -> str:
    """Return the unit of a sensor's readings."""
    kind, number = _SENSOR_KIND(model.sensor_type[sensor]), int(model.sensor_objid[sensor])
    if kind in _BY_DIFFERENCES:
        return _BY_DIFFERENCES[kind]
    if kind in _UNITLESS:
        return "1"
    turns = kind in _TURNING
    if kind in (_SENSOR_KIND.mjSENS_JOINTPOS, _SENSOR_KIND.mjSENS_JOINTVEL):
        turns = mujoco.mjtJoint(model.jnt_type[number]) == mujoco.mjtJoint.mjJNT_HINGE
    return ("rad" if turns else "m") + _RATES[order]


def _control_names(model: mujoco.MjModel) -> list[str]:
    """Return the name of each control, as motors are called."""
    names = []
    for actuator in range(model.nactuator):
        base, count = actuator_name(model, actuator), int(model.actuator_ctrlnum[actuator])
        names += [base] if count == 1 else [f"{base}.{k}" for k in range(count)]
    return names


def _joint_ports(model: mujoco.MjModel) -> list[str]:
    """Return the port of the force at each joint coordinate."""
    return [f"{JOINT_PREFIX}{name}" for name in coordinate_names(model)]


def _reading_slopes(pose: RestPose) -> _Slopes:
    """Return differences of MuJoCo's readings at rest by motions, wrenches and controls."""
    model, data = pose.model, pose.data
    nv, basis = model.nv, pose.basis
    flags = model.opt.disableflags
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL
    if pose.chains is not None:  # reactions need the rows of constraints
        model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
    rest = _read(pose, np.zeros((3, nv)))
    n = len(rest)
    motion = np.zeros((3, n, basis.shape[1]))
    for order, step in enumerate(_STEPS):
        for column, direction in enumerate(basis.T):
            change = np.zeros((3, nv))
            change[order] = step * direction
            motion[order, :, column] = (_read(pose, change) - _read(pose, -change)) / (2 * step)
    wrench = np.zeros((n, 6 * len(pose.stages)))
    for column in range(wrench.shape[1]):
        wrenches = np.zeros(wrench.shape[1])
        wrenches[column] = 1.0
        wrench[:, column] = _read(pose, np.zeros((3, nv)), wrenches=wrenches) - rest
    control = np.zeros((n, len(data.ctrl)))
    for column in range(control.shape[1]):
        control[:, column] = _read(pose, np.zeros((3, nv)), control=column) - rest
    if pose.chains is not None:
        at_joints = [_read(pose, np.zeros((3, nv)), forces=unit) - rest for unit in np.eye(nv)]
        control = np.column_stack([control, *at_joints])
    model.opt.disableflags = flags
    return _Slopes(motion, wrench, control)


def _read(
    pose: RestPose,
    change: Real,
    *,
    wrenches: Real | None = None,
    control: int | None = None,
    forces: Real | float = 0.0,
) -> Real:
    """Return MuJoCo's readings beside the state of rest, and the reactions; (n_reading,).

    Args:
        change: of positions, velocities and accelerations of the joints; (3, nv).
        wrenches: at the centres of mass of the stages; (6 n_body,).
        control: number of a control, or of the control of an activation, that is one unit larger.
        forces: at the joint coordinates, which only reactions read; (nv,).
    """
    model, probe = pose.model, copy.copy(pose.data)
    mujoco.mj_integratePos(model, probe.qpos, change[0], 1.0)
    probe.qvel[:] = change[1]
    if control is not None:
        change_command(model, probe, control, 1.0)
    if wrenches is not None:
        forces_there, moments = wrenches.reshape(-1, 2, 3).swapaxes(0, 1)
        arms = np.array(pose.centres) - pose.data.xipos[pose.stages]
        probe.xfrc_applied[pose.stages, :3] += forces_there
        probe.xfrc_applied[pose.stages, 3:] += moments + np.cross(arms, forces_there)
    mujoco.mj_fwdPosition(model, probe)
    mujoco.mj_sensorPos(model, probe)
    mujoco.mj_fwdVelocity(model, probe)
    mujoco.mj_sensorVel(model, probe)
    mujoco.mj_fwdActuation(model, probe)
    probe.qacc[:] = change[2]
    reactions = np.zeros(0)
    if pose.chains is not None:
        applied = 0.0 if wrenches is None else pose.jacobian.T @ wrenches
        reactions = pose.chains.react(probe, applied + forces)
    mujoco.mj_sensorAcc(model, probe)
    return np.concatenate([probe.sensordata, reactions])
