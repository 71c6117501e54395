"""Catalogue of effects: one file for each effect, which proposes its hypotheses for a machine.

Another package adds an effect by an entry point of the group ``mbw.effects``. Its name is that of
the effect, its object an ``Effect``. The hypotheses of such an effect are checked (``plugins.py``).
"""

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pkgutil import iter_modules

from diagnosis.effects.plugins import GROUP, describe_entry_point, load_effect
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
def load_catalogue() -> Mapping[str, Effect]:
    """Return all effects of this project and of installed packages, by name.

    Raises:
        InputError: an entry point cannot be loaded, is no Effect, or has the name of an effect.
    """
    effects = dict(EFFECTS)
    for point in entry_points(group=GROUP):
        if point.name in effects or point.name in PROVEN:
            raise InputError(
                f"{describe_entry_point(point.name)}: that effect is known already: give it "
                "another name, or uninstall its package"
            )
        effects[point.name] = load_effect(point)
    return effects


def check_others(session: Session) -> None:
    """Refuse effects of other packages that cannot be fitted, before any fit.

    They propose for the nominal model, as later for fits. Without such packages nothing is
    computed.

    Raises:
        InputError: a hypothesis cannot be fitted, or has a parameter of another effect.
    """
    effects = load_catalogue()
    if len(effects) == len(EFFECTS):
        return
    owners = {parameter.name: "the model" for parameter in session.model.parameters}
    for name, effect in effects.items():
        proposed = effect(Scene(session, session.model.drawn))
        parts = dict.fromkeys(part for hypothesis in proposed for part in hypothesis.parts)
        for parameter in (parameter for part in parts for parameter in part.parameters):
            owner = owners.setdefault(parameter.name, name)
            if owner != name:
                raise InputError(
                    f"{describe_entry_point(name)}: its parameter {parameter.name} has a name of "
                    f"{owner}: give it another"
                )


__all__ = ["EFFECTS", "PROVEN", "Effect", "check_others", "load_catalogue"]
