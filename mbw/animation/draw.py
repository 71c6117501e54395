"""Pictures of an animated mode: rendered by MuJoCo, or its outlines where nothing can render.

Contents of an animated mode: machine, motion of its bodies, measured motion of its sensors.
"""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from identification.words import Complex, Integers, Layout, Real
from mbmodel import Machine, MachineGeometry
from mbmodel.geometry.camera import Camera, frame_camera
from mbmodel.geometry.motion import cycle, geometry_points, motion_scale, move_points
from mbmodel.geometry.offscreen import render_machine
from mbw.page.picture import body_colours

SIZE = (800, 552)  # width and height of the machine's picture [pixels]: fits a slide and a mail
FRAMES = 30  # pictures of a cycle
FRAME_S = 0.06  # duration of a picture [s]: a multiple of 10 ms, as GIF files need
_MOTION_SHARE = 0.05  # largest motion over the size of the machine


@dataclass(frozen=True, eq=False)
class SensorMotion:
    """Motion of sensors that was measured.

    Args:
        places: at rest, in world axes [m]; (n_sensor, 3).
        shape: along world axes; (n_sensor, 3).
    """

    places: Real
    shape: Complex


@dataclass(frozen=True, eq=False)
class ModeScene:
    """A mode to be animated.

    Args:
        caption: words above the picture.
        layout: bodies with their centres of mass.
        geometry: surfaces and lines to draw.
        machine: machine for MuJoCo's renderer; None if there is no model.
        shape: translation and rotation of each body; (n_body, 6).
        sensors: measured motion; None for none.
    """

    caption: str
    layout: Layout
    geometry: MachineGeometry
    machine: Machine | None
    shape: Complex
    sensors: SensorMotion | None = None


@dataclass(frozen=True, eq=False)
class SceneMotion:
    """Motion of a scene, enlarged to be seen, picture by picture.

    Args:
        bodies: translation [m] and rotation [rad]; (n_frame, n_body, 6).
        points: vertices of the geometry [m]; (n_frame, n_point, 3).
        sensors: places of the sensors [m]; (n_frame, n_sensor, 3).
        camera: camera that holds all of them.
        factor: enlargement of the shape.
    """

    bodies: Real
    points: Real
    sensors: Real
    camera: Camera
    factor: float


def move_scene(scene: ModeScene, frames: int) -> SceneMotion:
    """Compute one cycle of a mode without its decay.

    The largest motion of a point is 5 % of the size of the machine.

    Args:
        frames: number of pictures; the first shows the real part of the shape.
    """
    points, stages = geometry_points(scene.geometry, scene.layout.bodies)
    sensors = scene.sensors or SensorMotion(np.zeros((0, 3)), np.zeros((0, 3), complex))
    extent = float(np.linalg.norm(np.ptp(np.vstack([points, sensors.places]), axis=0))) or 1.0
    factor = _enlargement(scene, points, stages, _MOTION_SHARE * extent)
    bodies = cycle(factor * scene.shape, frames)
    moved = np.stack([move_points(points, stages, scene.layout.centres, body) for body in bodies])
    places = sensors.places + cycle(factor * sensors.shape, frames)
    shown = np.vstack([moved.reshape(-1, 3), places.reshape(-1, 3), scene.layout.positions])
    return SceneMotion(bodies, moved, places, frame_camera(shown, SIZE[0] / SIZE[1]), factor)


def _enlargement(scene: ModeScene, points: Real, stages: Integers, largest: float) -> float:
    """Return the factor that enlarges a shape; sensors count where no body moves."""
    factor = motion_scale(points, stages, scene.layout.centres, scene.shape, largest)
    if scene.sensors is None or not len(scene.sensors.shape):
        return factor
    size = float(np.linalg.norm(scene.sensors.shape, axis=1).max())
    limits = [value for value in (factor, largest / size if size > 0 else 0.0) if value > 0]
    return min(limits, default=0.0)


_FINER = 2  # pictures are drawn in twice their size and reduced, so that edges are smooth
_STRIP = 48  # height of the strip with the caption above the machine [pixels]
_CAPTION_HEIGHT, _CAPTION_MARGIN = 22, 14  # of the letters, and from the edge [pixels]
_INK, _SENSOR, _TRACE = "#1d2430", "#c8102e", "#e89aa4"
_SENSOR_RADIUS = 4  # [pixels]
_OUTLINE_WIDTH = 2  # of an edge [pixels of the finer picture]


def draw_mode(scene: ModeScene, frames: int = FRAMES) -> tuple[list[Image.Image], bool]:
    """Return the pictures of one cycle, and whether MuJoCo has rendered them.

    Without a model or OpenGL, the edges of the bodies are drawn instead of their surfaces.

    Args:
        frames: number of pictures.
    """
    return draw_motion(scene, move_scene(scene, frames))


def draw_motion(
    scene: ModeScene, motion: SceneMotion, captions: Sequence[str] = ()
) -> tuple[list[Image.Image], bool]:
    """Return the pictures of any motion of a scene, and whether MuJoCo has rendered them.

    Args:
        scene: machine and its geometry.
        motion: enlarged motion, picture by picture.
        captions: of the pictures; that of the scene if there is none.
    """
    rendered = _render_pictures(scene, motion)
    has_surfaces = rendered is not None
    pictures = _outlines(scene, motion) if rendered is None else rendered
    captioned = [replace(scene, caption=caption) for caption in captions]
    scenes = captioned or [scene] * len(motion.bodies)
    return [_finish(scenes[k], motion, k, image) for k, image in enumerate(pictures)], has_surfaces


def outline_words(*, has_surfaces: bool) -> str:
    """Return what a message says of pictures that MuJoCo has not rendered."""
    if has_surfaces:
        return ""
    wanted = os.environ.get("MUJOCO_GL")
    why = f" (MUJOCO_GL is {wanted})" if wanted else ""
    return f", as outlines: MuJoCo cannot render here{why}"


def _finer() -> tuple[int, int]:
    return SIZE[0] * _FINER, SIZE[1] * _FINER


def _render_pictures(scene: ModeScene, motion: SceneMotion) -> Iterator[Image.Image] | None:
    """Return the machine on white, rendered by MuJoCo; None if that is impossible."""
    if scene.machine is None:
        return None
    pictures = render_machine(scene.machine, scene.geometry, motion.bodies, motion.camera, _finer())
    if pictures is None:
        return None
    return (
        Image.fromarray(np.where(is_machine[:, :, None], colours, 255).astype(np.uint8))
        for colours, is_machine in pictures
    )


def _outlines(scene: ModeScene, motion: SceneMotion) -> Iterator[Image.Image]:
    """Yield the edges of the bodies and the lines of the geometry, each body in its colour."""
    colours = body_colours(scene.layout.bodies)
    for points in motion.points:
        image = Image.new("RGB", _finer(), "white")
        pen = ImageDraw.Draw(image)
        pixels = motion.camera.project(points, *image.size)[0]
        start = 0
        for surface in scene.geometry.surfaces:
            corners = pixels[start : start + len(surface.vertices)]
            start += len(surface.vertices)
            colour = colours.get(surface.stage, _INK)
            for first, last in corners[surface.edges]:
                pen.line([*first, *last], fill=colour, width=_OUTLINE_WIDTH)
        for line in scene.geometry.lines:
            path = pixels[start : start + len(line.points)]
            start += len(line.points)
            colour = colours.get(line.stages[0], _INK)
            pen.line([tuple(pixel) for pixel in path], fill=colour, width=_OUTLINE_WIDTH)
        yield image


def _finish(scene: ModeScene, motion: SceneMotion, number: int, image: Image.Image) -> Image.Image:
    """Return a picture in its final size, with sensors and caption."""
    pen = ImageDraw.Draw(image)
    if scene.sensors is not None:
        _draw_sensors(pen, scene.sensors.places, motion.sensors[number], motion.camera, image.size)
    whole = Image.new("RGB", (SIZE[0], SIZE[1] + _STRIP), "white")
    whole.paste(image.reduce(_FINER), (0, _STRIP))
    font = ImageFont.load_default(_CAPTION_HEIGHT)
    place = (_CAPTION_MARGIN, _CAPTION_MARGIN)
    ImageDraw.Draw(whole).text(place, scene.caption, fill=_INK, font=font)
    return whole


def _draw_sensors(
    pen: ImageDraw.ImageDraw, rest: Real, moved: Real, camera: Camera, size: tuple[int, int]
) -> None:
    """Draw each sensor as a dot, with a line from its place at rest."""
    starts, ends = (camera.project(points, *size)[0] for points in (rest, moved))
    radius = _SENSOR_RADIUS * _FINER
    for first, last in zip(starts, ends, strict=True):
        pen.line([*first, *last], fill=_TRACE, width=_FINER)
        box = [last[0] - radius, last[1] - radius, last[0] + radius, last[1] + radius]
        pen.ellipse(box, fill=_SENSOR)
