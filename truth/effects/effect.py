"""What every effect must offer: its answer, its size, and how it changes the machine on test.

An effect acts at one of two places. What a stage, a joint's place, a sensor or a hammer *is*
belongs to ``to_machine``, before the equations are written; what is added to the equations or to
the readings belongs to ``to_rig``. One size tells how strong it is: everything else about it, its
place and its shape, is drawn before. So the size can be chosen such that a given share of the
effect survives a refit (``sizing``).

No effect at all: a machine that differs from its drawing by the tolerances alone.
"""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol, Self, TypeAlias

import numpy as np

from truth.errors import TruthError
from truth.machine.rig import Occasion, Prepared, Rig
from truth.machine.station import Station

Parameter: TypeAlias = float | tuple[float, ...]


@dataclass(frozen=True)
class Answer:
    """What a diagnosis should find; a location or direction that does not exist is empty.

    Args:
        effect: name in the catalogue.
        location: such as ``body:ty``.
        dof: such as ``tz``.
        parameters: by name, in SI units.
        kind: of an effect outside the catalogue, whose name is ``unexplained``.
    """

    effect: str
    location: str = ""
    dof: str = ""
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    kind: str = ""


def stated_number(name: str, value: Parameter) -> float:
    """Return the number that stands for a parameter.

    It is the length of a vector, and of the fractions that supports carry the smallest.

    Args:
        name: of the parameter.
        value: one number, or several.
    """
    values = np.asarray(value, np.float64)
    if not values.ndim:
        return float(values)
    return float(values.min() if name == "fraction" else np.linalg.norm(values))


class Effect(Protocol):
    """A drawn effect at its place, ready to be put into a machine.

    Attributes:
        size: how strong it is, more than 0; None for an effect that is there or not.
        limits: smallest and largest size that a machine could have; None without a size.
    """

    @property
    def size(self) -> float | None:
        """How strong it is."""
        ...

    @property
    def limits(self) -> tuple[float, float] | None:
        """Smallest and largest size."""
        ...

    def sized(self, size: float) -> Self:
        """Return the same effect, as strong as that."""
        ...

    def answer(self) -> Answer:
        """Return what is to be found."""
        ...

    def when(self, occasion: Occasion) -> Hashable:
        """Return what of an occasion matters: occasions with the same answer share a rig."""
        ...

    def to_machine(self, tested: Prepared, occasion: Occasion) -> Prepared:
        """Return the machine with the effect in its stages, sensors or hammers."""
        ...

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the effect in its equations or readings."""
        ...


class Always:
    """Defaults of an effect: the same on all occasions, nothing changed."""

    def when(self, occasion: Occasion) -> Hashable:
        """Return None: the effect is alike on all occasions."""
        return None

    def to_machine(self, tested: Prepared, occasion: Occasion) -> Prepared:
        """The machine as it is."""
        return tested

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """The rig as it is."""
        return rig


@dataclass(frozen=True, kw_only=True)
class Sized(Always):
    """An effect with a size, more than 0, which can be another while all else stays."""

    size: float

    def __post_init__(self) -> None:
        """Check the size; what has more to check calls this first."""
        self.require(0 < self.size < np.inf)

    def require(self, sensible: bool) -> None:
        """Refuse values that no machine has."""
        if not sensible:
            raise TruthError(f"{type(self).__name__}: its values make no sense: {self}")

    def sized(self, size: float) -> Self:
        """Return the same effect, as strong as that."""
        return replace(self, size=size)


@dataclass(frozen=True, kw_only=True)
class Vector(Sized):
    """An effect that is a vector in world axes: an offset [m], or a rotation vector [rad].

    Args:
        size: its length.
        along: the unit vector.
    """

    along: tuple[float, ...]

    @property
    def vector(self) -> tuple[float, ...]:
        """Return the vector."""
        return tuple(self.size * part for part in self.along)


class Unsized(Always):
    """An effect that is there or not."""

    @property
    def size(self) -> float | None:
        """Without a size."""
        return None

    @property
    def limits(self) -> tuple[float, float] | None:
        """Without a size, without limits."""
        return None

    def sized(self, size: float) -> Self:
        """There is no size to be changed."""
        raise TruthError(f"{type(self).__name__} is there or not, its size cannot be {size}")


@dataclass(frozen=True, eq=False)
class Scene:
    """What an effect may be drawn for.

    Args:
        station: the true machine.
        occasions: of its campaign.
        pace: band of the test over that of a usual station.
    """

    station: Station
    occasions: tuple[Occasion, ...]
    pace: float = 1.0


class Draw(Protocol):
    """A function that draws an effect, at the named place if one is named."""

    def __call__(
        self, random: np.random.Generator, scene: Scene, place: str | None
    ) -> Effect | None:
        """Draw the effect; None if the scene has no place for it.

        ``place`` is a location such as ``joint:ty``; what is not said by it is drawn.
        """
        ...


class Nothing(Unsized):
    """The absence of an effect."""

    def answer(self) -> Answer:
        """Return that there is nothing to be found."""
        return Answer("none")


def draw_nothing(random: np.random.Generator, scene: Scene, place: str | None) -> Nothing:
    """Return the absence of an effect, which has no place."""
    del random, scene
    if place is not None:
        raise TruthError(f"{place!r}: the effect none has no place; leave it out")
    return Nothing()
