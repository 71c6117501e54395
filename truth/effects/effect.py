"""What every effect must offer: its answer, and how it changes the equations of motion."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from truth.dynamics import Equations
from truth.station import Station


@dataclass(frozen=True)
class Answer:
    """What a diagnosis should find; a location or direction that does not exist is empty.

    Args:
        effect: name in the catalogue.
        location: such as ``body:ty``.
        dof: such as ``tz``.
        parameters: by name, in SI units.
    """

    effect: str
    location: str = ""
    dof: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)


class Effect(Protocol):
    """A drawn effect at its place, ready to be put into a machine."""

    def answer(self) -> Answer:
        """Return what is to be found."""
        ...

    def add(self, equations: Equations, station: Station) -> Equations:
        """Return the true station's equations with the effect in them."""
        ...


class Draw(Protocol):
    """A function that draws an effect, at the named body if one is named."""

    def __call__(self, random: np.random.Generator, station: Station, body: str | None) -> Effect:
        """Draw the effect for the true station; the body is drawn in any case."""
        ...
