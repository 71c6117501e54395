"""Effects that the catalogue lacks: a diagnosis should say ``unexplained``, and where."""

from collections.abc import Mapping
from types import MappingProxyType

from truth.effects.effect import Draw
from truth.effects.outside.changing_stiffness import draw_changing_stiffness
from truth.effects.outside.crosstalk import draw_crosstalk
from truth.effects.outside.fractional_damper import draw_fractional_damper
from truth.effects.outside.rocking_contact import draw_rocking_contact

OUTSIDE: Mapping[str, Draw] = MappingProxyType(
    {
        "fractional_damper": draw_fractional_damper,
        "changing_stiffness": draw_changing_stiffness,
        "crosstalk": draw_crosstalk,
        "rocking_contact": draw_rocking_contact,
    }
)

__all__ = ["OUTSIDE"]
