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
    """The springs and dampers of one joint or tendon: sum_i g_i (k_i + s c_i) g_i' + k_i G_i.

    G_i is the geometric stiffness of a tendon under tension, per unit of its stiffness. The
    equilibrium at which all this holds stays that of the drawing.

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
        changes: tuple[Change, ...] = (Change("joint", self._frame, self._frame, core),)
        if self._tense is not None:
            tension = np.zeros((3, *self._tense.shape[1:]))
            tension[0] = np.einsum("i,ijk", np.diag(core[0]), self._tense)
            changes += (self._everywhere(tension),)
        return changes

    def slopes(self, theta: Real, situation: Situation) -> tuple[Change, ...]:
        """One where a parameter stands in the core."""
        del theta, situation
        if self._tense is None:
            return (self._slope,)
        powers, springs = self._places
        core = np.zeros((len(powers), 3, *self._tense.shape[1:]))
        core[powers == 0, 0] = self._tense[springs[powers == 0]]
        return self._slope, self._everywhere(core)

    @cached_property
    def _tense(self) -> Real | None:
        """G_i of each spring, zero for those without tension; (n_spring, nv, nv)."""
        known = [spring.geometric for spring in self.springs if spring.geometric is not None]
        if not known:
            return None
        zero = np.zeros_like(known[0])
        return np.stack([zero if s.geometric is None else s.geometric for s in self.springs])

    @staticmethod
    def _everywhere(core: Real) -> Change:
        unit = np.eye(core.shape[-1])
        return Change("joint", unit, unit, core)

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
