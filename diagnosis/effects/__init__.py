"""The catalogue: one file for each effect, which proposes its hypotheses for a machine.

A package of others adds to it by an entry point of the group ``mbw.effects`` whose name is the
effect's and whose object is an ``Effect``; what these propose is checked (``guarded``).
"""

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pkgutil import iter_modules

from diagnosis.effects.plugins import GROUP, loaded, named
from diagnosis.effects.proven_by_data import PROVEN
from diagnosis.hypothesis import Effect, Scene
from identification.words import InputError
from tuning import Session

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
        InputError: an entry point cannot be loaded, is no Effect, or takes a name that is taken.
    """
    found = dict(EFFECTS)
    for point in entry_points(group=GROUP):
        if point.name in found or point.name in PROVEN:
            raise InputError(
                f"{named(point.name)}: that effect is known already: give it another name, or "
                "uninstall its package"
            )
        found[point.name] = loaded(point)
    return found


def check_others(session: Session) -> None:
    """Refuse effects of other packages that cannot be fitted, before anything is.

    They propose for the drawing, as they will for fits; where there are none it takes no time.

    Args:
        session: campaign and drawn model.

    Raises:
        InputError: a hypothesis that cannot be fitted, or parameters with names that are taken.
    """
    known = catalogue()
    if len(known) == len(EFFECTS):
        return
    owners = {parameter.name: "the model" for parameter in session.model.parameters}
    for name, effect in known.items():
        made = effect(Scene(session, session.model.drawn))
        parts = dict.fromkeys(part for one in made for part in one.parts)
        for parameter in (parameter for part in parts for parameter in part.parameters):
            owner = owners.setdefault(parameter.name, name)
            if owner != name:
                raise InputError(
                    f"{named(name)}: its parameter {parameter.name} has a name of {owner}: give "
                    "it another"
                )


__all__ = ["EFFECTS", "PROVEN", "Effect", "catalogue", "check_others"]
