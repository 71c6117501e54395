"""Entries of pseudo-forces and of loads on bodies that are not zero."""

from dataclasses import dataclass
from typing import Literal

from identification.words import Integers, Real

FORCE_TARGETS: tuple[Literal["force"], Literal["load"]] = ("force", "load")


@dataclass(frozen=True, eq=False)
class ForceEntries:
    """Entries of pseudo-forces or loads that are not zero, real and imaginary parts apart.

    Args:
        target: ``force`` on the joints' coordinates, or ``load`` on the bodies.
        coordinates: coordinate of each entry, in rising order; (n_entry,).
        parameters: number of its parameter among the chosen; (n_entry,).
        values: (n_entry, n_line, n_in, 2).
    """

    target: Literal["force", "load"]
    coordinates: Integers
    parameters: Integers
    values: Real
