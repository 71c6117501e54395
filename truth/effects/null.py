"""No effect at all: a machine that differs from its drawing by the tolerances alone."""

import numpy as np

from truth.effects.effect import Answer, Scene, Unsized
from truth.errors import TruthError


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
