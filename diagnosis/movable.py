"""An effect of bodies in terms that do not depend on the bodies, to carry it to others."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from identification.words import Real


@dataclass(frozen=True, eq=False)
class Movable:
    """What a hypothesis needs to take up the fitted values of the same effect at other bodies.

    Args:
        bodies: bodies on which the effect acts.
        read: returns its fitted values in SI units and world axes, by name.
        start: returns start values of its parameters from such values.
    """

    bodies: tuple[str, ...]
    read: Callable[[Mapping[str, float]], dict[str, Real]]
    start: Callable[[Mapping[str, Real]], dict[str, float]]
