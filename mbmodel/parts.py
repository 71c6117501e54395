"""Parts: named, parametrised changes of the equation of motion, low in rank.

Everything that can be tuned, tolerated or added to a machine is a Part:

    Zb(s) or Zj(s)  +=  left (core_0 + s core_1 + s^2 core_2) right'

in the slot of the bodies (centre-of-mass coordinates) or of the joints (joint coordinates), with
s = i w, time convention exp(+i w t).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from typing import Literal, Protocol

import numpy as np

from identification.words import Condition, Integers, Real
from mbmodel.machine import Machine, Spring

Slot = Literal["body", "joint"]


@dataclass(frozen=True)
class Parameter:
    """A number of a Part.

    Args:
        name: unique in a model, such as ``tilt_tz.stiffness``.
        drawn: its value on the drawing.
        unit: SI.
        positive: whether it is a size, tuned by its logarithm.
    """

    name: str
    drawn: float
    unit: str
    positive: bool = True


@dataclass(frozen=True, eq=False)
class Change:
    """What a Part adds in a slot: left (core_0 + s core_1 + s^2 core_2) right'.

    Args:
        slot: ``body`` (n = 6 n_body) or ``joint`` (n = nv).
        left, right: (n, r).
        core: coefficients of s^0, s^1, s^2; (..., 3, r, r). As a slope, the first axis runs over
            the Part's parameters.
    """

    slot: Slot
    left: Real
    right: Real
    core: Real


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
        """Where it sits: ``joint:<child body>``, ``body:<name>`` ..."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """What can vary."""

    def changes(self, theta: Real, situation: Situation) -> tuple[Change, ...]:
        """The finite change at theta."""

    def slopes(self, theta: Real, situation: Situation) -> tuple[Change, ...]:
        """Its derivative by each parameter; cores (n_parameter, 3, r, r)."""

    def write(self, theta: Real) -> Mapping[str, float]:
        """MJCF joint and tendon attributes that hold it: ``{'tilt_tz.stiffness': 4e8}``."""


@dataclass(frozen=True, eq=False)
class SpringPart:
    """The springs and dampers of one joint or tendon: sum_i g_i (k_i + s c_i) g_i'.

    Coefficients that are zero on the drawing stay zero: they have no logarithm to tune.
    """

    location: str
    springs: tuple[Spring, ...]

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Stiffness and damping of each spring where they are more than zero."""
        return tuple(
            Parameter(f"{spring.name}.{what}", value, unit)
            for spring in self.springs
            for what, value, unit in _coefficients(spring)
            if value > 0
        )

    @cached_property
    def _frame(self) -> Real:
        return np.array([spring.direction for spring in self.springs]).T

    @cached_property
    def _places(self) -> tuple[Integers, Integers]:
        """Power of s and spring of each parameter."""
        places = [
            (power, index)
            for index, spring in enumerate(self.springs)
            for power, (_, value, _) in enumerate(_coefficients(spring))
            if value > 0
        ]
        powers, springs = np.array(places, np.intp).reshape(-1, 2).T
        return powers, springs

    @cached_property
    def _slope(self) -> Change:
        powers, springs = self._places
        core = np.zeros((len(powers), 3, len(self.springs), len(self.springs)))
        core[np.arange(len(powers)), powers, springs, springs] = 1.0
        return Change("joint", self._frame, self._frame, core)

    def changes(self, theta: Real, situation: Situation) -> tuple[Change, ...]:
        """One change of rank n_spring with a diagonal core."""
        del situation
        size = len(self.springs)
        powers, springs = self._places
        core = np.zeros((3, size, size))
        core[powers, springs, springs] = theta
        return (Change("joint", self._frame, self._frame, core),)

    def slopes(self, theta: Real, situation: Situation) -> tuple[Change, ...]:
        """One where a parameter stands in the core."""
        del theta, situation
        return (self._slope,)

    def write(self, theta: Real) -> Mapping[str, float]:
        """The coefficients under their names."""
        names = (parameter.name for parameter in self.parameters)
        return dict(zip(names, map(float, theta), strict=True))


def _coefficients(spring: Spring) -> tuple[tuple[str, float, str], tuple[str, float, str]]:
    units = ("N m/rad", "N m s/rad") if spring.angular else ("N/m", "N s/m")
    return ("stiffness", spring.stiffness, units[0]), ("damping", spring.damping, units[1])


def spring_parts(machine: Machine) -> tuple[SpringPart, ...]:
    """One Part for each joint and tendon of the machine, in its order."""
    groups = groupby(machine.springs, key=lambda spring: spring.location)
    return tuple(SpringPart(location, tuple(springs)) for location, springs in groups)
