"""Measured modes as animated pictures or videos: ``mbw identify --animate 3 mode3.gif``."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from identification.result.stored_result import IdentificationResult
from identification.words import UsageError
from mbmodel import Machine, machine_geometry
from mbw.animation.draw import ModeScene, SensorMotion, draw_mode, outline_words
from mbw.animation.files import check_picture_target, write_pictures
from mbw.identify.files import nodes_of
from mbw.identify.page import body_motion, sensor_spokes
from mbw.messages import SCREEN


@dataclass(frozen=True)
class ModeAnimation:
    """A mode to be written as a picture.

    Args:
        mode: number of the mode in the table, from 1.
        target: file.
    """

    mode: int
    target: Path


def parse_animations(texts: Sequence[str]) -> tuple[ModeAnimation, ...]:
    """Return modes and files from texts ``NUMBER FILE``; files that cannot be written are refused.

    Raises:
        UsageError: a text is no number and file, or the kind of file is unknown.
        InputError: a file cannot be written.
    """
    animations = []
    for text in texts:
        number, _, name = text.partition(" ")
        if not (number.isdecimal() and int(number) > 0 and name):
            raise UsageError(
                f"--animate {text} does not state a mode and a file: write --animate 3 mode3.gif "
                "for the third mode of the table"
            )
        animations.append(ModeAnimation(int(number), Path(name)))
        check_picture_target(Path(name))
    return tuple(animations)


def refuse_missing_modes(animations: Sequence[ModeAnimation], count: int) -> None:
    """Refuse modes that were not identified.

    Raises:
        UsageError: a number is beyond the last mode.
    """
    for animation in animations:
        if animation.mode > count:
            there = f"{count} modes were identified" if count != 1 else "one mode was identified"
            raise UsageError(
                f"--animate {animation.mode}: {there} in this band: give the number of one of them"
            )


def write_animations(
    result: IdentificationResult, machine: Machine | None, animations: Sequence[ModeAnimation]
) -> None:
    """Write modes as pictures: bodies as the solids that fit their sensors best, sensors in red."""
    if not animations:
        return
    geometry = sensor_spokes(result) if machine is None else machine_geometry(machine)
    nodes, shapes = nodes_of(result), body_motion(result)
    for animation in animations:
        number = animation.mode - 1
        row = result.summary.modes[number]
        scene = ModeScene(
            f"Mode {animation.mode}: {row.frequency:.4g} Hz, damping {100 * row.damping:.3g} %",
            result.layout,
            geometry,
            machine,
            shapes[number].reshape(-1, 6),
            SensorMotion(nodes.positions, nodes.values[:, :, number]),
        )
        pictures, has_surfaces = draw_mode(scene)
        write_pictures(animation.target, pictures)
        how = outline_words(has_surfaces=has_surfaces)
        SCREEN.say(f"mode {animation.mode} in {animation.target}{how if machine else ''}")
