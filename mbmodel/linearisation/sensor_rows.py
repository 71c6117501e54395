r"""Readings of MuJoCo sensors per motion of the bodies, in closed form.

A frame at r from its body's centre of mass moves by v + theta x r and turns by theta. In the axes R
of a reference frame at p_ref,

    d[R' (p - p_ref)] = R' (dp - dp_ref - theta_ref x (p - p_ref)).

Velocities and accelerations of a machine at rest have the same rows, once and twice differentiated.
"""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from identification.words import Real
from mbmodel.linearisation.closed_chains import Chains
from mbmodel.linearisation.motors import wrench_at_bodies
from mbmodel.linearisation.tendon_slopes import tendon_jacobian
from mbmodel.mjcf.stages import stage_of
from mbmodel.mjcf.tendons import tendon_body_jacobian
from mbmodel.spatial import cross_matrix

_ROW_KIND = mujoco.mjtSensor
# Kinds by what they read of a frame, each with its order: 0 position, 1 velocity, 2 acceleration.
_TRANSLATION_KINDS = {
    _ROW_KIND.mjSENS_FRAMEPOS: 0,
    _ROW_KIND.mjSENS_FRAMELINVEL: 1,
    _ROW_KIND.mjSENS_FRAMELINACC: 2,
}
_ROTATION_KINDS = {_ROW_KIND.mjSENS_FRAMEANGVEL: 1, _ROW_KIND.mjSENS_FRAMEANGACC: 2}
_FRAME_AXIS_OF_KIND = {
    _ROW_KIND.mjSENS_FRAMEXAXIS: 0,
    _ROW_KIND.mjSENS_FRAMEYAXIS: 1,
    _ROW_KIND.mjSENS_FRAMEZAXIS: 2,
}
_SITE_TRANSLATION_KINDS = {_ROW_KIND.mjSENS_VELOCIMETER: 1, _ROW_KIND.mjSENS_ACCELEROMETER: 2}
_JOINT_KINDS = {_ROW_KIND.mjSENS_JOINTPOS: 0, _ROW_KIND.mjSENS_JOINTVEL: 1}
_TENDON_KINDS = {_ROW_KIND.mjSENS_TENDONPOS: 0, _ROW_KIND.mjSENS_TENDONVEL: 1}
_ACTUATOR_KINDS = {_ROW_KIND.mjSENS_ACTUATORPOS: 0, _ROW_KIND.mjSENS_ACTUATORVEL: 1}


@dataclass(frozen=True, eq=False)
class SensorRows:
    """Rows of one MuJoCo sensor.

    Args:
        order: 0, 1, 2 for a reading of position, velocity or acceleration.
        body: reading per motion of the centres of mass; (dim, 6 n_body).
        joint: reading per joint coordinate, where the sensor reads joints; (dim, nv).
    """

    order: int
    body: Real
    joint: Real


@dataclass(frozen=True, eq=False)
class RestPose:
    """A compiled model at its static equilibrium, with its stages.

    Args:
        model: the compiled model.
        data: at static equilibrium.
        stages: MJCF body number of each stage.
        centres: centre of mass of each stage [m]; (3,) each.
        jacobian: T; (6 n_body, nv).
        chains: closed chains; None without any.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    stages: list[int]
    centres: tuple[Real, ...]
    jacobian: Real
    chains: Chains | None = None

    @property
    def basis(self) -> Real:
        """Motion of the joints per coordinate of the machine; (nv, n)."""
        return np.eye(self.model.nv) if self.chains is None else self.chains.basis

    def frame_rows(self, body: int, position: Real) -> tuple[Real, Real]:
        """Return translation and rotation of a frame on a body, in world axes; (3, 6 n_body) each.

        Args:
            body: MJCF number of the body.
            position: of the frame's origin [m]; (3,).
        """
        translation, rotation = np.zeros((2, 3, len(self.stages), 6))
        stage = stage_of(self.model, body)
        if stage in self.stages:
            number = self.stages.index(stage)
            translation[:, number, :3] = rotation[:, number, 3:] = np.eye(3)
            translation[:, number, 3:] = -cross_matrix(position - self.centres[number])
        return translation.reshape(3, -1), rotation.reshape(3, -1)

    def empty(self, dim: int) -> tuple[Real, Real]:
        """Return rows of zeros for bodies and for joints."""
        return np.zeros((dim, len(self.jacobian))), np.zeros((dim, self.model.nv))


def closed_form_rows(pose: RestPose, sensor: int) -> SensorRows | None:
    """Return the rows of a MuJoCo sensor, or None for a kind without a closed form here.

    Args:
        sensor: its number.
    """
    kind = _ROW_KIND(pose.model.sensor_type[sensor])
    readers: tuple[tuple[dict[mujoco.mjtSensor, int], Callable[..., SensorRows]], ...] = (
        (_JOINT_KINDS, _joint_rows),
        (_TENDON_KINDS, _tendon_rows),
        (_ACTUATOR_KINDS, _actuator_rows),
        (_TRANSLATION_KINDS, _frame_sensor_rows),
        (_ROTATION_KINDS, _frame_sensor_rows),
        (_FRAME_AXIS_OF_KIND, _frame_sensor_rows),
        (_SITE_TRANSLATION_KINDS, _site_rows),
        ({_ROW_KIND.mjSENS_GYRO: 1}, _site_rows),
    )
    for kinds, read in readers:
        if kind in kinds:
            return read(pose, sensor, 0 if kinds is _FRAME_AXIS_OF_KIND else kinds[kind])
    return None


def _joint_rows(pose: RestPose, sensor: int, order: int) -> SensorRows:
    """Return the row of a joint's position or velocity."""
    body, joint = pose.empty(1)
    joint[0, pose.model.jnt_dofadr[pose.model.sensor_objid[sensor]]] = 1.0
    return SensorRows(order, body, joint)


def _tendon_rows(pose: RestPose, sensor: int, order: int) -> SensorRows:
    """Return the row of a tendon's length: at joints if it is fixed, else at the bodies."""
    tendon = int(pose.model.sensor_objid[sensor])
    body, joint = pose.empty(1)
    pulls = tendon_body_jacobian(pose.model, pose.data, pose.stages, pose.centres)
    if tendon in pulls:
        body[0] = pulls[tendon]
    else:
        joint[0] = tendon_jacobian(pose.model, pose.data)[tendon]
    return SensorRows(order, body, joint)


def _actuator_rows(pose: RestPose, sensor: int, order: int) -> SensorRows:
    """Return the row of an actuator's length: its moments, at the bodies where it acts there."""
    model, data = pose.model, pose.data
    actuator = int(model.sensor_objid[sensor])
    moment = np.zeros((model.nu, model.nv))
    mujoco.mju_sparse2dense(
        moment, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
    )
    body, joint = pose.empty(1)
    pulls = tendon_body_jacobian(model, data, pose.stages, pose.centres)
    wrench = wrench_at_bodies(model, data, actuator, pulls, pose.stages, pose.centres)
    if wrench is None:
        joint[0] = moment[actuator]
    else:
        row = pose.jacobian.T @ wrench
        body[0] = wrench * (moment[actuator] @ row) / max(float(row @ row), np.finfo(float).tiny)
        joint[0] = moment[actuator] - pose.jacobian.T @ body[0]
    return SensorRows(order, body, joint)


def _site_rows(pose: RestPose, sensor: int, order: int) -> SensorRows:
    """Return the rows of an accelerometer, velocimeter or gyro in the axes of its site."""
    site = int(pose.model.sensor_objid[sensor])
    axes = pose.data.site_xmat[site].reshape(3, 3)
    translation, rotation = pose.frame_rows(pose.model.site_bodyid[site], pose.data.site_xpos[site])
    is_gyro = _ROW_KIND(pose.model.sensor_type[sensor]) == _ROW_KIND.mjSENS_GYRO
    return SensorRows(order, axes.T @ (rotation if is_gyro else translation), pose.empty(3)[1])


def _frame_sensor_rows(pose: RestPose, sensor: int, order: int) -> SensorRows:
    """Return the rows of a sensor of a frame, in the axes of its reference if it has one."""
    model, kind = pose.model, _ROW_KIND(pose.model.sensor_type[sensor])
    body, position, axes = _frame(pose, model.sensor_objtype[sensor], model.sensor_objid[sensor])
    translation, rotation = pose.frame_rows(body, position)
    if has_reference := model.sensor_refid[sensor] >= 0:
        base, origin, base_axes = _frame(
            pose, model.sensor_reftype[sensor], model.sensor_refid[sensor]
        )
        base_translation, base_rotation = pose.frame_rows(base, origin)
        translation = (
            translation - base_translation + cross_matrix(position - origin) @ base_rotation
        )
        rotation = rotation - base_rotation
    if kind in _TRANSLATION_KINDS:
        rows = translation
    elif kind in _ROTATION_KINDS:
        rows = rotation
    else:
        rows = -cross_matrix(axes[:, _FRAME_AXIS_OF_KIND[kind]]) @ rotation
    return SensorRows(order, base_axes.T @ rows if has_reference else rows, pose.empty(3)[1])


def _frame(pose: RestPose, kind: int, number: int) -> tuple[int, Real, Real]:
    """Return MJCF body number, position [m] and axes in columns of an element's frame."""
    model, data = pose.model, pose.data
    objects = mujoco.mjtObj
    places = {
        objects.mjOBJ_BODY: (np.arange(model.nbody), data.xipos, data.ximat),
        objects.mjOBJ_XBODY: (np.arange(model.nbody), data.xpos, data.xmat),
        objects.mjOBJ_GEOM: (model.geom_bodyid, data.geom_xpos, data.geom_xmat),
        objects.mjOBJ_SITE: (model.site_bodyid, data.site_xpos, data.site_xmat),
        objects.mjOBJ_CAMERA: (model.cam_bodyid, data.cam_xpos, data.cam_xmat),
    }
    bodies, positions, axes = places[objects(kind)]
    return int(bodies[number]), positions[number], axes[number].reshape(3, 3)
