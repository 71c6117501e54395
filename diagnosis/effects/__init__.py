"""The catalogue: one file for each effect, which proposes its hypotheses for a machine.

A package of others adds to it by an entry point of the group ``mbw.effects`` whose name is the
effect's and whose object is an ``Effect``.
"""

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pkgutil import iter_modules

from diagnosis.effects.gates import PROVEN
from diagnosis.hypothesis import Effect
from identification.words import InputError

GROUP = "mbw.effects"
_MODULES = (import_module(f"{__name__}.{info.name}") for info in iter_modules(__path__))
EFFECTS: Mapping[str, Effect] = {
    module.__name__.rpartition(".")[2]: module.EFFECT
    for module in _MODULES
    if hasattr(module, "EFFECT")
}


@cache
def catalogue() -> Mapping[str, Effect]:
    """All effects by name: ours, and those of installed packages.

    Raises:
        InputError: an entry point is no Effect, or takes a name that is taken.
    """
    found = dict(EFFECTS)
    for point in entry_points(group=GROUP):
        effect = point.load()
        if not isinstance(effect, Effect):
            raise InputError(f"entry point {point.name} of {GROUP}: {point.value} is no Effect")
        if point.name in found or point.name in PROVEN:
            raise InputError(f"entry point {point.name} of {GROUP}: that effect is known already")
        found[point.name] = effect
    return found


__all__ = ["EFFECTS", "PROVEN", "Effect", "catalogue"]
