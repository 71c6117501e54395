"""Pictures of an animated mode: rendered by MuJoCo, or its outlines where nothing can render."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from identification.words import Real
from mbmodel.geometry.camera import Camera
from mbmodel.geometry.offscreen import render_machine
from mbw.animation.scene import FRAMES, SIZE, ModeScene, SceneMotion, move_scene
from mbw.page.picture import body_colours

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
        scene: mode to be animated.
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
