"""Animated motion of a machine that was simulated: slowed down and enlarged to be seen."""

from pathlib import Path

import numpy as np

from identification.words import Real
from mbmodel import Machine, machine_geometry
from mbmodel.geometry.camera import frame_camera
from mbmodel.geometry.motion import geometry_points, motion_scale, move_points
from mbw.animation.draw import FRAME_S, SIZE, ModeScene, SceneMotion, draw_motion, outline_words
from mbw.animation.files import write_pictures
from mbw.messages import SCREEN

_PICTURE_COUNT = 120  # pictures: 7 s
_FRAMES_PER_PERIOD = 14.0  # of the strongest frequency, so that its motion is seen as one
_MOTION_SHARE_OF_SIZE = 0.05  # largest motion over the size of the machine
_START_SHARE_OF_MOTION = 0.05  # of the largest motion: the pictures begin just before it
_FRAMES_BEFORE_START = 4


def write_animation(target: Path, machine: Machine, time_s: Real, motion: Real) -> None:
    """Write the motion of a machine as an animated picture or a video.

    The pictures begin where the machine begins to move. They show the whole response if it is
    slow, and its beginning in slow motion if it vibrates: 14 pictures a period of the frequency
    that carries most of the motion.

    Args:
        target: file that ``check_picture_target`` accepts.
        machine: that was simulated.
        time_s: evenly spaced instants [s]; (n_time,).
        motion: translation [m] and rotation [rad] of each body; (n_time, 6 n_body).
    """
    instants = _choose_instants(time_s, motion)
    chosen = np.stack([np.interp(instants, time_s, column) for column in motion.T], axis=1).reshape(
        len(instants), -1, 6
    )
    scene_motion = _enlarge(machine, chosen)
    scene = ModeScene(
        "",
        machine.layout,
        machine_geometry(machine),
        machine,
        np.zeros((len(machine.layout.bodies), 6), complex),
    )
    slow = FRAME_S / (instants[1] - instants[0])
    factor = float(f"{scene_motion.factor:.2g}")
    captions = [
        f"{1e3 * instant:.1f} ms, {slow:.3g} times slower, {factor:,.6g} times larger"
        for instant in instants
    ]
    pictures, has_surfaces = draw_motion(scene, scene_motion, captions)
    write_pictures(target, pictures)
    how = outline_words(has_surfaces=has_surfaces)
    SCREEN.say(f"motion in {target}{how}")


def _choose_instants(time_s: Real, motion: Real) -> Real:
    """Return the instants of the pictures [s]; (n_frame,)."""
    size = np.abs(motion).max(axis=1)
    first = int(np.argmax(size >= _START_SHARE_OF_MOTION * size.max(initial=0.0)))
    duration, step = time_s[-1] - time_s[0], time_s[1] - time_s[0]
    column = motion[:, int(np.argmax(motion.std(axis=0)))]
    power = np.abs(np.fft.rfft(column - column.mean())) ** 2
    frequency = np.fft.rfftfreq(len(column), step)[int(np.argmax(power))]
    whole = duration / (_PICTURE_COUNT - 1)
    interval = min(whole, 1 / (_FRAMES_PER_PERIOD * frequency)) if frequency > 0 else whole
    begin = time_s[first] - _FRAMES_BEFORE_START * interval
    begin = max(time_s[0], min(begin, time_s[-1] - interval * (_PICTURE_COUNT - 1)))
    instants: Real = begin + interval * np.arange(_PICTURE_COUNT)
    return instants


def _enlarge(machine: Machine, motion: Real) -> SceneMotion:
    """Return the motion enlarged so that it is seen.

    Args:
        machine: with its geometry.
        motion: of each body at each picture; (n_frame, n_body, 6).
    """
    layout = machine.layout
    points, stages = geometry_points(machine_geometry(machine), layout.bodies)
    largest = _MOTION_SHARE_OF_SIZE * (float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0)
    factors = [motion_scale(points, stages, layout.centres, shape, largest) for shape in motion]
    factor = min((value for value in factors if value > 0), default=0.0)
    bodies = factor * motion
    moved = np.stack([move_points(points, stages, layout.centres, body) for body in bodies])
    shown = np.vstack([moved.reshape(-1, 3), layout.positions])
    places = np.zeros((len(bodies), 0, 3))
    return SceneMotion(bodies, moved, places, frame_camera(shown, SIZE[0] / SIZE[1]), factor)
