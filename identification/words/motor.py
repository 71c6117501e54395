"""An actuator as an input: its control instead of a force at a point."""

from dataclasses import dataclass
from typing import Self

from identification.words.dof import Dof


@dataclass(frozen=True, order=True)
class Motor:
    """The control of an actuator, by its name in the model.

    Args:
        name: of the actuator.
    """

    name: str

    def __post_init__(self) -> None:
        """Check the name."""
        if not self.name or ":" in self.name:
            raise ValueError(f"{self.name!r} is no name of a motor: empty, or with a colon")

    @property
    def sign(self) -> int:
        """Plus one: a control has no direction."""
        return 1

    @property
    def positive(self) -> Self:
        """Itself."""
        return self

    def __str__(self) -> str:
        """The name."""
        return self.name


Input = Dof | Motor
