"""What the effects outside the catalogue share: where they sit, and that nobody expects them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from truth.effects.effect import Answer, Parameter, Sized
from truth.effects.places import StageDirection


@dataclass(frozen=True)
class Unexplained(Sized):
    """An effect on one direction of a joint that the catalogue does not name.

    Args:
        size: how strong it is.
    """

    direction: StageDirection
    kind: ClassVar[str]

    def parameters(self) -> Mapping[str, Parameter]:
        """Return what describes it, by name, in SI units."""
        raise NotImplementedError

    def answer(self) -> Answer:
        """Return what is to be found: that no effect of the catalogue explains the gap."""
        return Answer(
            "unexplained",
            location=self.direction.location,
            dof=self.direction.dof,
            parameters=self.parameters(),
            kind=self.kind,
        )
