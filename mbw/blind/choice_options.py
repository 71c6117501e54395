"""Which effects, places and sizes a blind test draws, from the options of the command."""

import math
from collections.abc import Sequence

from identification.words import UsageError
from truth import Choice
from truth.effects.other_packages import known_effects


def read_choice(
    effects: Sequence[str] | None,
    places: Sequence[str] | None,
    ratios: Sequence[float] | None,
    size: str | None,
    dirt: float,
) -> Choice:
    """Return the choice of the options.

    Args:
        effects: names of effects; None for the whole deck.
        places: locations such as ``joint:ty``.
        ratios: survival ratios.
        size: ``parameter=value`` of the answer, such as ``mass=5``.
        dirt: part of the motion that small imperfections leave, in per cent.

    Raises:
        UsageError: an effect is unknown, or an option needs an effect.
    """
    for name in effects or ():
        if name not in known_effects() or name == "none":
            choices = ", ".join(effect for effect in known_effects() if effect != "none")
            raise UsageError(f"--effect {name!r} is unknown: choose from {choices}")
    if not effects and (places or ratios or size):
        raise UsageError("--place, --ratio and --size need an effect: name it by --effect")
    if ratios and size:
        raise UsageError("--ratio and --size exclude each other: give one of them")
    if not all(0 < ratio < math.inf for ratio in ratios or ()):
        raise UsageError("--ratio: give a survival ratio of more than 0, such as 2")
    return Choice(
        tuple(effects or ()), tuple(places or ()), tuple(ratios or ()), _read_size(size), dirt
    )


def _read_size(text: str | None) -> tuple[str, float] | None:
    """Return name and value of ``parameter=value``."""
    if text is None:
        return None
    name, _, value = text.partition("=")
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise UsageError(f"--size {text!r}: give parameter=value, such as mass=5")
    return name, number
