"""What a Part is: a named, parametrised change of the equation of motion, low in rank.

    H(s) = s^q L T Z(s)^-1 T' P,   Z(s) = T' Zb(s) T + Zj(s),   s = i w, convention exp(+i w t)

Everything that can be tuned, tolerated or added to a machine is a Part. It adds
left core(s) right' in one of five slots:

    slot     adds to              left x right                         powers of s
    body     Zb, bodies           6 n_body x 6 n_body                  0, 1, 2
    joint    Zj, joints           nv x nv                              0, 1, 2
    path     T, kinematics        6 n_body x nv                        0
    sensor   L, rows of a point   6 directions of it x 6 n_body        0
    hammer   P', columns likewise 6 directions of it x 6 n_body        0
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

from identification.words import Complex, Condition, Real
from mbmodel.machine import Machine
from mbmodel.mjcf.edit import Addition, Edit, NotHeld

Slot = Literal["body", "joint", "path", "sensor", "hammer"]

# How well a drawing knows a number: not at all, exactly, or within a tolerance of its own.
Known = Literal[
    "free",
    "exactly",
    "mass",
    "inertia",
    "com",
    "joint_position",
    "sensor_gain",
    "sensor_angle",
    "sensor_position",
    "hammer_angle",
    "hammer_position",
]


@dataclass(frozen=True)
class Parameter:
    """A number of a Part.

    Args:
        name: unique in a model, such as ``tilt_tz.stiffness``.
        drawn: its value on the drawing.
        unit: SI.
        positive: whether it is a size, tuned by its logarithm.
        known: how well the drawing knows it: ``free`` is not at all, else a tolerance of campaigns.
    """

    name: str
    drawn: float
    unit: str
    positive: bool = True
    known: Known = "free"


@dataclass(frozen=True, eq=False)
class Change:
    """What a Part adds in a slot: f(s) left (core_0 + s core_1 + s^2 core_2) right'.

    Args:
        slot: which factor of the equation changes.
        left: (n, r).
        right: (m, t).
        core: coefficients of s^0, s^1, s^2; (..., 3, r, t). As a slope, the first axis runs over
            the Part's parameters.
        point: the sensor or hammer point meant, in those slots.
        shape: f(s) by which all is multiplied, for what is no polynomial; f(conj s) = conj f(s).
            As a finite change of bodies and joints only.
    """

    slot: Slot
    left: Real
    right: Real
    core: Real
    point: str = ""
    shape: Callable[[Complex], Complex] | None = None


@dataclass(frozen=True, eq=False)
class Situation:
    """Where a Part is asked for its change.

    Args:
        machine: whose equation changes.
        condition: of the test, or None where no test is meant.
    """

    machine: Machine
    condition: Condition | None = None


class Part(Protocol):
    """A named, parametrised change. ``theta`` holds the values of its own parameters."""

    @property
    def location(self) -> str:
        """Where it sits: ``joint:<child body>``, ``body:<name>``, ``sensor:<site>`` ..."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """What can vary."""

    def changes(self, theta: Real, situation: Situation) -> tuple[Change, ...]:
        """The finite change at theta."""

    def slopes(self, theta: Real, situation: Situation) -> tuple[Change, ...]:
        """Its derivative by each parameter; cores (n_parameter, 3, r, t)."""

    def write(self, theta: Real) -> tuple[Edit | Addition | NotHeld, ...]:
        """What to write into the MJCF, and what it cannot hold."""


@runtime_checkable
class Conditional(Protocol):
    """A Part that acts in some tests only: what it changes elsewhere is nothing."""

    def acts(self, condition: Condition | None) -> float:
        """How much of it acts in a test: 1 all, 0 nothing."""
