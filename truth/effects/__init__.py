"""What a machine may have that its drawing lacks: one file per effect, listed here by name."""

from collections.abc import Mapping
from types import MappingProxyType

from truth.effects.appendage import Appendage, draw_appendage
from truth.effects.effect import Answer, Draw, Effect
from truth.effects.nothing import Nothing, draw_nothing

CATALOGUE: Mapping[str, Draw] = MappingProxyType(
    {"none": draw_nothing, "appendage": draw_appendage}
)

__all__ = ["CATALOGUE", "Answer", "Appendage", "Draw", "Effect", "Nothing"]
