"""Actuator as an input of FRFs: its control signal instead of a force at a point."""

from dataclasses import dataclass
from typing import Self

from identification.words.dof import Dof


@dataclass(frozen=True, order=True)
class Motor:
    """Control signal of an actuator, by its name in the model.

    Args:
        name: name of the actuator.

    Raises:
        ValueError: the name is empty or has a colon.
    """

    name: str

    def __post_init__(self) -> None:
        """Check the name."""
        if not self.name or ":" in self.name:
            raise ValueError(
                f"{self.name!r} is not the name of a motor: it is empty or has a colon"
            )

    @property
    def sign(self) -> int:
        """Always +1: a control signal has no direction."""
        return 1

    @property
    def positive(self) -> Self:
        """This motor itself, as for a degree of freedom with positive sign."""
        return self

    def __str__(self) -> str:
        """Return the name."""
        return self.name


Input = Dof | Motor
