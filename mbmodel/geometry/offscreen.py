"""Pictures of a machine by MuJoCo's renderer, without a window."""

import os
import sys
from collections.abc import Iterator
from importlib import import_module
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from identification.words import Real
from mbmodel.geometry.camera import VIEW_ANGLE_DEG, Camera
from mbmodel.geometry.surfaces import MachineGeometry, pose_machine
from mbmodel.machine import Machine
from mbmodel.spatial import rotation_matrix

Image = NDArray[np.uint8]

_MAX_GEOMS = 20_000  # of a scene, sites and tendons included
_BOX_COLOUR = np.array([0.42, 0.53, 0.68, 1.0], np.float32)  # of a body without a geom
_AMBIENT, _DIFFUSE = 0.3, 0.55  # of the light at the camera: dark stages stay visible
_FLAG = mujoco.mjtRndFlag
# A picture to paste shows the machine alone, on white.
_SWITCHED_OFF = (_FLAG.mjRND_SHADOW, _FLAG.mjRND_REFLECTION, _FLAG.mjRND_SKYBOX, _FLAG.mjRND_HAZE)
_GROUND = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))
_BACKGROUND_DEPTH = 1.0  # depth of a pixel that shows nothing
# Values of MUJOCO_GL, as in MuJoCo.
_NO_RENDERER = ("disable", "disabled", "off", "false", "0")
_ANY_RENDERER = ("", "enable", "enabled", "on", "true", "1")
_GLFW_NAMES = ("glx", "wgl")  # window systems that MuJoCo reaches through GLFW
# MuJoCo's own default for Linux needs a display.
_DEFAULT_RENDERERS = {"linux": "egl", "darwin": "cgl"}


def render_machine(
    machine: Machine,
    geometry: MachineGeometry,
    motions: Real,
    camera: Camera,
    size: tuple[int, int],
) -> Iterator[tuple[Image, NDArray[np.bool_]]] | None:
    """Render a machine whose bodies are moved from rest.

    The picture shows the machine alone: neither sky nor planes. Bodies move as given, whatever
    their joints allow: a measured shape has motions that a model lacks.

    Args:
        machine: read from an MJCF that still exists.
        geometry: of that machine; its boxes stand for bodies without a geom.
        motions: translation [m] and rotation [rad] of each body, picture by picture;
            (n_picture, n_body, 6).
        camera: point of view.
        size: width and height of the pictures [pixels].

    Returns:
        Pictures (height, width, 3), each with the pixels that show the machine (height, width);
        None where there is no OpenGL, or where ``MUJOCO_GL`` disables it.
    """
    context = _open_context(*size)
    if context is None:
        return None
    model, data, stages = pose_machine(machine)
    model.vis.global_.offwidth, model.vis.global_.offheight = size
    model.vis.global_.fovy = VIEW_ANGLE_DEG
    model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:] = _AMBIENT, _DIFFUSE
    model.vis.quality.offsamples = 0  # pixels are either machine or background
    try:
        renderer = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, renderer)
    except mujoco.FatalError:
        context.free()
        return None
    places = [machine.layout.bodies.index(name) if name else -1 for name in stages]
    opened = (model, data, renderer, context)
    return _pictures(opened, np.array(places), machine, geometry, motions, camera)


def _open_context(width: int, height: int) -> Any:
    """Return an OpenGL context without a window, current in this thread; None if there is none."""
    backend = os.environ.get("MUJOCO_GL", "").strip().lower()
    if backend in _NO_RENDERER:
        return None
    if backend in _ANY_RENDERER:
        backend = _DEFAULT_RENDERERS.get(sys.platform, "glfw")
    elif backend in _GLFW_NAMES:
        backend = "glfw"
    try:
        context = import_module(f"mujoco.{backend}").GLContext(width, height)
        context.make_current()
    except Exception:  # whatever a driver or a missing library raises
        return None
    return context


def _pictures(
    opened: tuple[mujoco.MjModel, mujoco.MjData, Any, Any],
    places: NDArray[np.intp],
    machine: Machine,
    geometry: MachineGeometry,
    motions: Real,
    camera: Camera,
) -> Iterator[tuple[Image, NDArray[np.bool_]]]:
    """Yield the pictures, and free the renderer after the last one."""
    model, data, renderer, context = opened
    width, height = model.vis.global_.offwidth, model.vis.global_.offheight
    rest = [np.array(values) for values in (data.geom_xpos, data.geom_xmat, data.site_xpos)]
    scene = mujoco.MjvScene(model, _MAX_GEOMS)
    for flag in _SWITCHED_OFF:
        scene.flags[flag] = 0
    for geom in np.flatnonzero(np.isin(model.geom_type, _GROUND)):
        model.geom_matid[geom], model.geom_rgba[geom, 3] = -1, 0.0
    eye = mujoco.MjvCamera()
    eye.type = mujoco.mjtCamera.mjCAMERA_FREE
    eye.lookat, eye.distance = camera.centre, camera.distance
    eye.azimuth, eye.elevation = camera.azimuth_deg, camera.elevation_deg
    view = mujoco.MjrRect(0, 0, width, height)
    colours, depth = np.zeros((height, width, 3), np.uint8), np.zeros((height, width), np.float32)
    try:
        for motion in motions:
            _move_scene(model, data, rest, places, machine.layout.centres, motion)
            mujoco.mjv_updateScene(
                model, data, mujoco.MjvOption(), None, eye, mujoco.mjtCatBit.mjCAT_ALL, scene
            )
            _add_boxes(scene, geometry, machine, motion)
            context.make_current()
            mujoco.mjr_render(view, scene, renderer)
            mujoco.mjr_readPixels(colours, depth, view, renderer)
            yield colours[::-1].copy(), (depth < _BACKGROUND_DEPTH)[::-1].copy()
    finally:
        renderer.free()
        context.free()


def _move_scene(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    rest: list[Real],
    places: NDArray[np.intp],
    centres: Real,
    motion: Real,
) -> None:
    """Move geoms, sites and tendons with their bodies, from rest."""
    geom_places, site_places = places[model.geom_bodyid], places[model.site_bodyid]
    data.geom_xpos[:], data.geom_xmat[:], data.site_xpos[:] = rest
    for body, centre in enumerate(centres):
        turn = rotation_matrix(motion[body, 3:])
        shift = centre + motion[body, :3]
        geoms, sites = geom_places == body, site_places == body
        data.geom_xpos[geoms] = shift + (rest[0][geoms] - centre) @ turn.T
        data.geom_xmat[geoms] = (turn @ rest[1][geoms].reshape(-1, 3, 3)).reshape(-1, 9)
        data.site_xpos[sites] = shift + (rest[2][sites] - centre) @ turn.T
    mujoco.mj_tendon(model, data)


def _add_boxes(
    scene: mujoco.MjvScene, geometry: MachineGeometry, machine: Machine, motion: Real
) -> None:
    """Add the boxes of bodies without a geom to a scene."""
    for surface in geometry.surfaces:
        if surface.stage not in geometry.boxed or scene.ngeom >= scene.maxgeom:
            continue
        body = machine.layout.bodies.index(surface.stage)
        mujoco.mjv_initGeom(
            scene.geoms[scene.ngeom],
            mujoco.mjtGeom.mjGEOM_BOX,
            np.ptp(surface.vertices, axis=0) / 2,
            machine.layout.centres[body] + motion[body, :3],
            rotation_matrix(motion[body, 3:]).ravel(),
            _BOX_COLOUR,
        )
        scene.ngeom += 1
