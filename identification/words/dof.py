"""A degree of freedom: a signed direction at a named point."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self

from identification.words.errors import UsageError

DIRECTIONS = ("tx", "ty", "tz", "rx", "ry", "rz")
_LABEL = re.compile(r"(?P<point>.+):(?P<sign>[+-]?)(?P<axis>[tr]?[xyz])")


@dataclass(frozen=True, order=True)
class Dof:
    """A signed direction at a named point, such as ``acc11:+tx`` or ``ty:-rz``.

    Translations are along, rotations about the axes of the point: a sensor's or hammer's own
    axes, world axes for the centre of mass of a body.

    Args:
        point: name of a site or of a body.
        direction: sign and one of tx ty tz rx ry rz.
    """

    point: str
    direction: str

    def __post_init__(self) -> None:
        """Check both fields."""
        if not self.point or ":" in self.point:
            raise ValueError(f"{self.point!r} is no name of a point: empty, or with a colon")
        if self.direction[:1] not in ("+", "-") or self.direction[1:] not in DIRECTIONS:
            raise ValueError(
                f"{self.direction!r} is no direction: write a sign and one of "
                + " ".join(DIRECTIONS)
            )

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read ``point:direction``; x y z stand for tx ty tz and a missing sign for plus.

        Raises:
            UsageError: the text is no label.
        """
        match = _LABEL.fullmatch(text.strip())
        if match is None or ":" in match["point"]:
            raise UsageError(f"{text!r} is no label: write <point>:<sign><direction>, acc11:+tx")
        axis = match["axis"]
        return cls(
            match["point"], (match["sign"] or "+") + ("t" + axis if len(axis) == 1 else axis)
        )

    @classmethod
    def of(cls, point: str, axis: int, sign: int = 1) -> Self:
        """Build from the axis number 0..5 (tx ty tz rx ry rz) and a sign."""
        return cls(point, ("-" if sign < 0 else "+") + DIRECTIONS[axis])

    @property
    def axis(self) -> int:
        """Number of the axis: 0..2 along x y z, 3..5 about x y z."""
        return DIRECTIONS.index(self.direction[1:])

    @property
    def sign(self) -> int:
        """Plus or minus one."""
        return -1 if self.direction[0] == "-" else 1

    @property
    def is_rotation(self) -> bool:
        """Whether it turns about its axis."""
        return self.axis > 2

    @property
    def positive(self) -> Self:
        """The same degree of freedom along the positive axis."""
        return type(self).of(self.point, self.axis)

    def __str__(self) -> str:
        """The label."""
        return f"{self.point}:{self.direction}"


def distinct(dofs: Iterable[Dof]) -> tuple[Dof, ...]:
    """Each degree of freedom once, along its positive axis, in the order of first appearance."""
    return tuple(dict.fromkeys(dof.positive for dof in dofs))
