"""Difference of a written machine from the one that was meant."""

from dataclasses import dataclass

# Of the largest entry of a matrix: two ways to compute it in double precision agree better.
MAX_RELATIVE_DIFFERENCE = 1e-9


@dataclass(frozen=True)
class Difference:
    """Largest difference of a written machine.

    Args:
        what: quantity that differs, such as ``mass``, ``stiffness``, ``point`` or ``motor``.
        place: joint coordinate, body, point or motor at which it is largest.
        relative: difference over the largest entry.
    """

    what: str
    place: str
    relative: float

    def __str__(self) -> str:
        """Return it in words."""
        return f"the {self.what} at {self.place} differs by {100 * self.relative:.2g} %"
