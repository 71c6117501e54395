"""Geometry of an MJCF's elements in their bodies' frames, as it is written back to the file.

"The drawing" is the nominal model: the MJCF as it was read.
"""

from dataclasses import dataclass
from itertools import product

import mujoco
import numpy as np

from identification.words import Real
from mbmodel.mjcf.names import body_name, joint_name
from mbmodel.mjcf.stages import stage_members, tied_stages
from mbmodel.spatial import spatial_inertia

_ONE_COORDINATE = (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE)  # one coordinate each


@dataclass(frozen=True, eq=False)
class DrawnElement:
    """A joint or site in the frame of its body.

    Args:
        name: of the element.
        frame: axes at rest in which the element is written, in columns, in world axes: those of its
            body; for a joint, those before this and later joints of the body turn; (3, 3).
        position: in that frame [m]; (3,).
        axes: in that frame, in columns: three of a site, one of a joint; (3, 3) or (3, 1).
        armature: rotor inertia of a joint [kg, kg m^2]; 0 of a site.
        at_rest: displacement of a slide or hinge at rest [m, rad]; 0 of others.
    """

    name: str
    frame: Real
    position: Real
    axes: Real
    armature: float = 0.0
    at_rest: float = 0.0


@dataclass(frozen=True, eq=False)
class DrawnBody:
    """Frame and inertia of the MJCF body that leads a stage, without the bodies welded to it.

    Args:
        origin: of its frame at rest, in world axes [m]; (3,).
        frame: its axes at rest, in columns, in world axes; (3, 3).
        inertia: spatial inertia about the stage's centre of mass, world axes; (6, 6).
        centre: the stage's centre of mass [m]; (3,).
        geoms: lowest and highest corner of the box about the geoms of the whole stage, along the
            world axes [m]; (2, 3); no rows without geoms.
    """

    origin: Real
    frame: Real
    inertia: Real
    centre: Real
    geoms: Real


@dataclass(frozen=True, eq=False)
class Drawing:
    """Elements of the MJCF by name.

    Args:
        joints: by the name of the joint.
        sites: by the name of the site.
        bodies: by the name of the stage.
        ties: pairs of stages, or of a stage and the ground, that a constraint ties.
    """

    joints: dict[str, DrawnElement]
    sites: dict[str, DrawnElement]
    bodies: dict[str, DrawnBody]
    ties: frozenset[frozenset[str]]


def read_drawing(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    stages: dict[str, int],
    centres: tuple[Real, ...],
) -> Drawing:
    """Collect joints, sites and bodies from a compiled model at rest.

    Args:
        stages: MJCF body number of each stage, by the stage's name.
        centres: centre of mass of each stage [m]; (3,) each.
    """

    def frame(body: int) -> Real:
        axes: Real = data.xmat[body].reshape(3, 3).copy()
        return axes

    joints = {
        joint_name(model, k): DrawnElement(
            joint_name(model, k),
            _joint_frame(model, data, k),
            model.jnt_pos[k].copy(),
            model.jnt_axis[k].reshape(3, 1).copy(),
            float(model.dof_armature[model.jnt_dofadr[k]]),
            float(data.qpos[model.jnt_qposadr[k]])
            if mujoco.mjtJoint(model.jnt_type[k]) in _ONE_COORDINATE
            else 0.0,
        )
        for k in range(model.njnt)
    }
    sites = {}
    for k in range(model.nsite):
        if not (name := model.site(k).name):
            continue
        axes = np.zeros(9)
        mujoco.mju_quat2Mat(axes, model.site_quat[k])
        sites[name] = DrawnElement(
            name, frame(model.site_bodyid[k]), model.site_pos[k].copy(), axes.reshape(3, 3)
        )
    bodies = {
        name: _drawn_body(model, data, body, centre)
        for (name, body), centre in zip(stages.items(), centres, strict=True)
    }
    ties = (
        frozenset(body_name(model, stage) for stage in tied) for tied in tied_stages(model).values()
    )
    return Drawing(joints, sites, bodies, frozenset(ties))


def _joint_frame(model: mujoco.MjModel, data: mujoco.MjData, joint: int) -> Real:
    """Return the axes in which a joint is written: the body's before it and later joints turn."""
    body = model.jnt_bodyid[joint]
    axes: Real = data.xmat[body].reshape(3, 3).copy()
    first = model.body_jntadr[body]
    for later in reversed(range(joint, first + model.body_jntnum[body])):
        turned = np.zeros(4)
        address = model.jnt_qposadr[later]
        kind = mujoco.mjtJoint(model.jnt_type[later])
        if kind == mujoco.mjtJoint.mjJNT_HINGE:
            angle = data.qpos[address] - model.qpos0[address]
            mujoco.mju_axisAngle2Quat(turned, model.jnt_axis[later], angle)
        elif kind == mujoco.mjtJoint.mjJNT_BALL:
            turned[:] = data.qpos[address : address + 4]
        else:
            continue
        matrix = np.zeros(9)
        mujoco.mju_quat2Mat(matrix, turned)
        axes = axes @ matrix.reshape(3, 3).T
    return axes


def _drawn_body(model: mujoco.MjModel, data: mujoco.MjData, body: int, centre: Real) -> DrawnBody:
    """Return frame and inertia of one MJCF body."""
    axes = data.ximat[body].reshape(3, 3)
    inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
    return DrawnBody(
        data.xpos[body].copy(),
        data.xmat[body].reshape(3, 3).copy(),
        spatial_inertia(float(model.body_mass[body]), data.xipos[body] - centre, inertia),
        centre,
        _box_geoms(model, data, body),
    )


def _box_geoms(model: mujoco.MjModel, data: mujoco.MjData, stage: int) -> Real:
    """Return the box about the geoms of a stage; (2, 3), or (0, 3) if it has none.

    MuJoCo has a box about each geom in the geom's own axes. Those of a mesh are its principal
    axes, so that its vertices are taken instead. Planes have no end.
    """
    corners = np.array(list(product((-1.0, 1.0), repeat=3)))
    pieces = [np.zeros((0, 3))]
    for geom in np.flatnonzero(np.isin(model.geom_bodyid, stage_members(model, stage))):
        kind = model.geom_type[geom]
        if kind == mujoco.mjtGeom.mjGEOM_PLANE:
            continue
        if kind == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.mesh(model.geom_dataid[geom])
            first = int(mesh.vertadr[0])
            points = model.mesh_vert[first : first + int(mesh.vertnum[0])].astype(float)
        else:
            middle, half = model.geom_aabb[geom].reshape(2, 3)
            points = middle + half * corners
        pieces.append(points @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
    points = np.vstack(pieces)
    return np.array([points.min(axis=0), points.max(axis=0)]) if len(points) else points
