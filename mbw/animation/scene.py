"""Contents of an animated mode: machine, motion of its bodies, measured motion of its sensors."""

from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Integers, Layout, Real
from mbmodel import Machine, MachineGeometry
from mbmodel.geometry.camera import Camera, frame_camera
from mbmodel.geometry.motion import cycle, geometry_points, motion_scale, move_points

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
        scene: mode to be animated.
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
