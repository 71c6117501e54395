"""Transfer of the fitted values of an effect from one body to another."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from identification.words import Real


@dataclass(frozen=True, eq=False)
class Movable:
    """Conversion between the parameters of an effect and values that hold at every body.

    Args:
        bodies: bodies on which the effect acts.
        read: returns values in SI units and world axes from the fitted parameters.
        start: returns start values of the parameters from such values.
        shape: name of the shape in a scan, which a family and its members share; empty where the
            coordinates tell shapes apart.
    """

    bodies: tuple[str, ...]
    read: Callable[[Mapping[str, float]], dict[str, Real]]
    start: Callable[[Mapping[str, Real]], dict[str, float]]
    shape: str = ""
