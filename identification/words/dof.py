"""Degree of freedom: a signed direction at a named point."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol, Self, TypeVar

from identification.words.errors import UsageError

DIRECTIONS = ("tx", "ty", "tz", "rx", "ry", "rz")
_LABEL_PATTERN = re.compile(r"(?P<point>.+):(?P<sign>[+-]?)(?P<axis>[tr]?[xyz])")


@dataclass(frozen=True, order=True)
class Dof:
    """Degree of freedom: a signed direction at a named point, such as ``acc11:+tx``.

    A translation is along an axis of the point, a rotation about it. The axes are those of the
    sensor or hammer point; at the centre of mass of a body they are the world axes.

    Args:
        point: name of a site or of a body.
        direction: a sign and one of tx ty tz rx ry rz.

    Raises:
        ValueError: the name is empty, or the direction is none of these.
    """

    point: str
    direction: str

    def __post_init__(self) -> None:
        """Check the point and the direction."""
        if not self.point:
            raise ValueError("the name of a point is empty")
        if self.direction[:1] not in ("+", "-") or self.direction[1:] not in DIRECTIONS:
            raise ValueError(
                f"{self.direction!r} is not a direction: write a sign and one of "
                + " ".join(DIRECTIONS)
            )

    @classmethod
    def parse(cls, text: str) -> Self:
        """Parse a label ``point:direction``.

        The axes x y z stand for tx ty tz; a missing sign means plus. The last colon counts: names
        of points may have others.

        Raises:
            UsageError: the text is not such a label.
        """
        match = _LABEL_PATTERN.fullmatch(text.strip())
        if match is None:
            raise UsageError(
                f"{text!r} is not a label: write <point>:<sign><direction>, such as acc11:+tx"
            )
        axis = match["axis"]
        return cls(
            match["point"], (match["sign"] or "+") + ("t" + axis if len(axis) == 1 else axis)
        )

    @classmethod
    def of(cls, point: str, axis: int, sign: int = 1) -> Self:
        """Build a degree of freedom from its axis number 0..5 (tx ty tz rx ry rz) and sign."""
        return cls(point, ("-" if sign < 0 else "+") + DIRECTIONS[axis])

    @property
    def axis(self) -> int:
        """Number of the axis: 0..2 along x y z, 3..5 about x y z."""
        return DIRECTIONS.index(self.direction[1:])

    @property
    def sign(self) -> int:
        """Sign of the direction: +1 or -1."""
        return -1 if self.direction[0] == "-" else 1

    @property
    def is_rotation(self) -> bool:
        """Whether this is a rotation about its axis."""
        return self.axis > 2

    @property
    def positive(self) -> Self:
        """Degree of freedom along the positive axis, whatever the sign of this one."""
        return self if self.sign > 0 else type(self).of(self.point, self.axis)

    def __str__(self) -> str:
        """Return the label ``point:direction``."""
        return f"{self.point}:{self.direction}"


class _Signed(Protocol):
    """A label with a sign: a degree of freedom, or a motor, whose sign is always plus."""

    @property
    def positive(self) -> Self:
        """Label along the positive axis."""


_Label = TypeVar("_Label", bound=_Signed)


def distinct_dofs(dofs: Iterable[_Label]) -> tuple[_Label, ...]:
    """Return each label once, with positive sign, in the order of first appearance."""
    return tuple(dict.fromkeys(dof.positive for dof in dofs))
