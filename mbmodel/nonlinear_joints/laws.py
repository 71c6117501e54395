r"""Laws of nonlinear joints, each with the MJCF elements that hold it.

x is the coordinate of a slide or hinge, measured from the joint's ``springref``; the joint's force
is minus what is stated here.

| law | force | MJCF |
|---|---|---|
| polynomial | k x + k2 x^2 + k3 x^3 | ``stiffness="k k2 k3"`` of the joint |
| Jenkins (1962) | k (x - y), at most the limit; y slips | fixed tendon with ``springyield`` |
| dry friction (Coulomb) | the limit, against the motion | ``frictionloss`` of the joint |
| gap | k (x -+ gap) beyond +-gap, less a preload | fixed tendon with a dead band |

A gap is a tendon's dead band, not a second joint with a limit: its stops are springs of the stated
stiffness, and no constraint of MuJoCo, whose stiffness grows with the inertia behind it, takes
part.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Real, UsageError
from mbmodel.mjcf.edit import Addition, Edit, Element
from mbmodel.nonlinear_joints.friction_solver import FRICTION_SOLVER

FRICTION_SUFFIX, GAP_SUFFIX, PRELOAD_SUFFIX = "_friction", "_gap", "_preload"
# Stiffness of the spring that gives a preload, over that of the gap's stops: the preload changes
# by this share of what the stops carry.
PRELOAD_STIFFNESS_RATIO = 1e-6


@dataclass(frozen=True)
class PolynomialSpring:
    """A spring k x + k2 x^2 + k3 x^3; hardening if k3 > 0, softening if k3 < 0.

    Args:
        joint: name of the slide or hinge.
        k: [N/m or N m/rad].
        k2: [N/m^2 or N m/rad^2].
        k3: [N/m^3 or N m/rad^3].
    """

    joint: str
    k: float
    k2: float = 0.0
    k3: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        _refuse_negative(self.joint, k=self.k)
        _refuse_infinite(self.joint, k2=self.k2, k3=self.k3)

    def follow(self, path: Real) -> Real:
        """Return the force along a path of the coordinate; (n,)."""
        return self.k * path + self.k2 * path**2 + self.k3 * path**3

    def changes(self, spring_reference: float) -> tuple[Edit | Addition, ...]:
        """Return what is written into the MJCF.

        Args:
            spring_reference: coordinate of the joint at which its spring is free.
        """
        del spring_reference
        return (Edit("spring", self.joint, {"stiffness": (self.k, self.k2, self.k3)}),)


@dataclass(frozen=True)
class JenkinsElement:
    """A spring in series with a slider, beside the joint's own spring (Jenkins 1962).

    Args:
        joint: name of the slide or hinge.
        k: stiffness while it sticks [N/m or N m/rad].
        limit: force at which it slides [N or N m].
    """

    joint: str
    k: float
    limit: float

    def __post_init__(self) -> None:
        """Check the numbers."""
        _refuse_nonpositive(self.joint, k=self.k, limit=self.limit)

    def follow(self, path: Real) -> Real:
        """Return the force along a path of the coordinate that begins without slip; (n,)."""
        reach, slip = self.limit / self.k, 0.0
        force = np.empty(len(path))
        for number, place in enumerate(path):
            slip = float(np.clip(slip, place - reach, place + reach))
            force[number] = self.k * (place - slip)
        return force

    def changes(self, spring_reference: float) -> tuple[Edit | Addition, ...]:
        """Return what is written into the MJCF.

        Args:
            spring_reference: coordinate of the joint at which its spring is free.
        """
        del spring_reference
        values: dict[str, float | Sequence[float]] = {
            "stiffness": self.k,
            "springyield": self.limit / self.k,
        }
        return (_fixed_tendon(self.joint, FRICTION_SUFFIX, values),)


@dataclass(frozen=True)
class DryFriction:
    """Coulomb friction, MuJoCo's ``frictionloss``.

    Args:
        joint: name of the slide or hinge.
        limit: force while it slides, and at most while it sticks [N or N m].
    """

    joint: str
    limit: float

    def __post_init__(self) -> None:
        """Check the number."""
        _refuse_nonpositive(self.joint, limit=self.limit)

    def follow(self, path: Real) -> Real:
        """Return the force along a path of the coordinate; zero until it moves; (n,)."""
        direction = np.sign(np.diff(path, prepend=path[:1]))
        for number in range(1, len(direction)):
            direction[number] = direction[number] or direction[number - 1]
        return self.limit * direction

    def changes(self, spring_reference: float) -> tuple[Edit | Addition, ...]:
        """Return what is written into the MJCF.

        Args:
            spring_reference: coordinate of the joint at which its spring is free.
        """
        del spring_reference
        values: dict[str, float | Sequence[float]] = {"frictionloss": self.limit}
        return (Edit("spring", self.joint, values | FRICTION_SOLVER),)


@dataclass(frozen=True)
class GapSpring:
    """A spring with play: no force within the gap, k beyond it; a preload pushes to one side.

    It replaces the joint's own spring.

    Args:
        joint: name of the slide or hinge.
        k: stiffness of the stops [N/m or N m/rad].
        gap: to either side [m or rad].
        preload: constant force towards positive coordinates [N or N m].
    """

    joint: str
    k: float
    gap: float
    preload: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        _refuse_nonpositive(self.joint, k=self.k, gap=self.gap)
        _refuse_infinite(self.joint, preload=self.preload)

    def follow(self, path: Real) -> Real:
        """Return the force along a path of the coordinate; (n,)."""
        return self.k * (path - np.clip(path, -self.gap, self.gap)) - self.preload

    def changes(self, spring_reference: float) -> tuple[Edit | Addition, ...]:
        """Return what is written into the MJCF.

        Args:
            spring_reference: coordinate of the joint at which its spring is free.
        """
        band = (spring_reference - self.gap, spring_reference + self.gap)
        values: dict[str, float | Sequence[float]] = {"stiffness": self.k, "springlength": band}
        stops = _fixed_tendon(self.joint, GAP_SUFFIX, values)
        free = Edit("spring", self.joint, {"stiffness": (0.0, 0.0, 0.0)})
        if not self.preload:
            return (free, stops)
        weak = PRELOAD_STIFFNESS_RATIO * self.k
        length = spring_reference + self.preload / weak
        push = _fixed_tendon(
            self.joint, PRELOAD_SUFFIX, {"stiffness": weak, "springlength": (length, length)}
        )
        return (free, stops, push)


NonlinearJoint = PolynomialSpring | JenkinsElement | DryFriction | GapSpring


def _fixed_tendon(joint: str, suffix: str, values: dict[str, float | Sequence[float]]) -> Addition:
    """Return a fixed tendon over one joint, whose length is the joint's coordinate."""
    wrap = Element("joint", {"joint": joint, "coef": 1.0})
    name = f"{joint}{suffix}"
    return Addition(name, "tendon", Element("fixed", {"name": name, **values}, (wrap,)))


def _refuse_negative(joint: str, **numbers: float) -> None:
    _refuse_infinite(joint, **numbers)
    for name, value in numbers.items():
        if value < 0:
            raise UsageError(f"joint {joint!r}: {name} is {value:g}: give a number of 0 or more")


def _refuse_nonpositive(joint: str, **numbers: float) -> None:
    _refuse_infinite(joint, **numbers)
    for name, value in numbers.items():
        if value <= 0:
            raise UsageError(f"joint {joint!r}: {name} is {value:g}: give a number above 0")


def _refuse_infinite(joint: str, **numbers: float) -> None:
    for name, value in numbers.items():
        if not np.isfinite(value):
            raise UsageError(f"joint {joint!r}: {name} is {value}: give a finite number")
