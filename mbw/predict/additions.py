"""Texts of ``--mount``, ``--at`` and ``--add-mass``: what is put on a machine, and where."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from identification.words import InputError, UsageError
from mbmodel import MountedStage, Offset, PointMass

# A mass or a distance beyond these is a slip of a unit: no precision machine weighs or reaches so
# much.
_MAX_ADDED_MASS_KG = 1e6
_MAX_OFFSET_M = 1e3


@dataclass(frozen=True)
class Additions:
    """A mounted stage and point masses that a machine gets.

    Args:
        stage: the mounted stage; None for none.
        masses: point masses.
    """

    stage: MountedStage | None
    masses: tuple[PointMass, ...]

    def __bool__(self) -> bool:
        """Return whether anything is added."""
        return self.stage is not None or bool(self.masses)

    def __str__(self) -> str:
        """Return what is put on the machine in words."""
        words = [] if self.stage is None else [f"{self.stage.path.name} on {self.stage.body}"]
        words += [f"{mass.mass_kg:g} kg on {mass.body}" for mass in self.masses]
        return ", ".join(words)


def parse_additions(mount: Path | None, place: str | None, masses: Sequence[str]) -> Additions:
    """Return the additions that the options name.

    Args:
        mount: MJCF of the stage; None for none.
        place: text ``BODY:SITE`` or ``BODY:x,y,z``; None for none.
        masses: texts ``BODY=KG@x,y,z``.

    Raises:
        UsageError: an option that is incomplete or written otherwise.
        InputError: a number without sense.
    """
    if (mount is None) != (place is None):
        missing = "--at BODY:PLACE" if place is None else "--mount STAGE.xml"
        raise UsageError(f"--mount and --at go together: add {missing}")
    stage = None
    if mount is not None and place is not None:
        body, colon, spot = place.partition(":")
        if not (colon and body and spot):
            raise UsageError(
                f"--at {place!r}: write BODY:SITE or BODY:x,y,z (in m from the body's centre of "
                "mass), such as hexapod:0,0,0.05"
            )
        stage = MountedStage(mount, body, _offset(f"--at {place}", spot) if "," in spot else spot)
    return Additions(stage, tuple(_parse_mass(text) for text in masses))


def _parse_mass(text: str) -> PointMass:
    """Return the point mass of a text ``BODY=KG@x,y,z``."""
    body, equals, rest = text.partition("=")
    number, at, spot = rest.partition("@")
    mass = _number(number)
    if not (equals and at and body and spot) or mass is None:
        raise UsageError(
            f"--add-mass {text!r}: write BODY=KG@x,y,z (in m from the body's centre of mass), such "
            "as hexapod=12.5@0,0,0.1"
        )
    if not 0 < mass <= _MAX_ADDED_MASS_KG:
        raise InputError(
            f"--add-mass {text}: give a mass above 0 and up to {_MAX_ADDED_MASS_KG:g} kg"
        )
    return PointMass(body, mass, _offset(f"--add-mass {text}", spot))


def _offset(option: str, text: str) -> Offset:
    """Return the three numbers of a text ``x,y,z``.

    Args:
        option: option with its value, for messages.
        text: the numbers [m].
    """
    numbers = [_number(word) for word in text.split(",")]
    if len(numbers) != 3 or None in numbers:
        raise UsageError(f"{option}: {text!r} is no place: write three numbers x,y,z in m")
    x, y, z = (float(number or 0.0) for number in numbers)
    if not all(abs(value) <= _MAX_OFFSET_M for value in (x, y, z)):
        raise InputError(f"{option}: give x,y,z in m, up to {_MAX_OFFSET_M:g} m")
    return x, y, z


def _number(text: str) -> float | None:
    """Return a finite number, or None."""
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
