"""No effect at all: a machine that differs from its drawing by the tolerances alone."""

import numpy as np

from truth.dynamics import Equations
from truth.effects.effect import Answer
from truth.errors import TruthError
from truth.station import Station


class Nothing:
    """The absence of an effect."""

    def answer(self) -> Answer:
        """Return that there is nothing to be found."""
        return Answer("none")

    def add(self, equations: Equations, station: Station) -> Equations:
        """Return the equations as they are."""
        return equations


def draw_nothing(random: np.random.Generator, station: Station, body: str | None) -> Nothing:
    """Return the absence of an effect, which has no body."""
    if body is not None:
        raise TruthError(f"body {body!r}: the effect none has no place; leave the body out")
    return Nothing()
