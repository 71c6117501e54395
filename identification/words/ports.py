"""Ports of a machine: directions at points, and signals by their names in the model.

Degree of freedom: a signed direction at a named point.
"""

import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
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


JOINT_PREFIX = "joint:"  # of signals of joints, such as joint:ty_tx
OFFSET_MARK = "@"  # between a body and the offset of a point: ty@0,0,0.2:+tx
FLOOR = "floor"  # the point of labels for motions of the floor, where no site has that name
PAIR_MARK = "-"  # between two points whose difference is meant: coil-magnet:+tx
_SIGNED_DIRECTION = re.compile(r"(?P<place>.+):(?P<sign>[+-]?)(?P<axis>[tr]?[xyz])")


@dataclass(frozen=True, order=True)
class Signal:
    """A port by its name in the model, instead of a direction at a drawn point.

    As an input it is a motor's control (``ty_drive``), the force or torque along a joint
    (``joint:ty_tx``), a pair of opposite forces at two points (``coil-magnet:+tx``) or a force at a
    point beside a body's centre of mass (``ty@0,0,0.2:+tx``). As an output it is the reading of a
    MuJoCo sensor (``encoder``, ``imu.2`` for its third number), the position of a joint, the
    difference of two points, or the motion of the point beside the centre of mass.

    Args:
        name: the name; a difference or a point beside the centre of mass ends in a sign and a
            direction.

    Raises:
        ValueError: the name is empty, or its colon is none of a joint, pair or offset.
    """

    name: str

    def __post_init__(self) -> None:
        """Check the name, and write its direction in full."""
        if not self.name or (
            ":" in self.name
            and not self.is_joint
            and _SIGNED_DIRECTION.fullmatch(self.name) is None
        ):
            raise ValueError(
                f"{self.name!r} is not the name of a motor, joint, sensor, pair or point: it is "
                "empty or has a colon"
            )
        if self.is_directed:
            place, direction = self.name.rsplit(":", 1)
            sign = direction[0] if direction[0] in "+-" else "+"
            axis = direction.lstrip("+-")
            axis = axis if len(axis) > 1 else f"t{axis}"
            object.__setattr__(self, "name", f"{place}:{sign}{axis}")

    @property
    def is_joint(self) -> bool:
        """Whether it is the coordinate of a joint."""
        return self.name.startswith(JOINT_PREFIX) and len(self.name) > len(JOINT_PREFIX)

    @property
    def is_directed(self) -> bool:
        """Whether it has a direction: a difference of two points, or a point beside a centre."""
        return ":" in self.name and not self.is_joint

    @property
    def place(self) -> str:
        """Name without sign and direction."""
        return self.name.rsplit(":", 1)[0] if self.is_directed else self.name

    @property
    def point(self) -> str:
        """Name by which gain, delay and corrections of this port go: it is a place of its own."""
        return self.positive.name

    @property
    def direction(self) -> str:
        """Sign and direction if it has one, else empty."""
        return self.name.rsplit(":", 1)[1] if self.is_directed else ""

    @property
    def axis(self) -> int:
        """Number of its axis: 0..5 of tx ty tz rx ry rz, and 0 without a direction."""
        return DIRECTIONS.index(self.direction[1:]) if self.is_directed else 0

    @property
    def sign(self) -> int:
        """Sign of the direction; +1 without one."""
        return -1 if self.direction.startswith("-") else 1

    @property
    def is_rotation(self) -> bool:
        """Whether its direction is a rotation; a joint or sensor is asked of the machine."""
        return self.axis > 2

    @property
    def positive(self) -> Self:
        """This signal with a positive sign."""
        return self if self.sign > 0 else replace(self, name=f"{self.place}:+{self.direction[1:]}")

    def __str__(self) -> str:
        """Return the name."""
        return self.name


Port = Dof | Signal
Input = Port
Output = Port


def parse_port(text: str, points: Collection[str] = ()) -> Port:
    """Return the direction at a point, or the signal, that a text names.

    A text without a colon is a signal, and so is a label of a joint. The point of another label is
    a drawn one, unless it has an offset or is a pair.

    Args:
        text: such as ``acc11:+tx``, ``ty_drive``, ``joint:ty_tx`` or ``coil-magnet:+tx``.
        points: names of points and bodies; their names may hold the marks of offsets and pairs.

    Raises:
        UsageError: the text is no such label.
    """
    name = text.strip()
    if name and ":" not in name:
        return Signal(name)
    if name.startswith(JOINT_PREFIX) and len(name) > len(JOINT_PREFIX):
        return Signal(name)
    dof = Dof.parse(name)
    return settle_port(dof, points)


def split_label(text: str) -> tuple[str, str]:
    """Return place and direction of a label as text, such as ``acc11`` and ``tx``.

    A signal without direction, such as ``joint:ty_tx``, has an empty one.
    """
    match = None if text.startswith(JOINT_PREFIX) else _SIGNED_DIRECTION.fullmatch(text)
    if match is None:
        return text, ""
    axis = match["axis"]
    return match["place"], axis if len(axis) > 1 else f"t{axis}"


def settle_port(port: Port, points: Collection[str]) -> Port:
    """Return a label as a direction at a drawn point if there is the point, else as a signal.

    Args:
        port: parsed before the names of points were known.
        points: names of points and bodies.
    """
    if isinstance(port, Signal):
        if port.is_directed and port.place in points:
            return Dof(port.place, port.direction)
        return port
    has_mark = OFFSET_MARK in port.point or PAIR_MARK in port.point.strip(PAIR_MARK)
    return Signal(str(port)) if has_mark and port.point not in points else port
