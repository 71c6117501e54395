"""Effects that other packages draw, by entry points of ``mbw.truth_effects``.

An entry point names a function like those of the catalogue: it draws the effect for a scene.
"""

from collections.abc import Mapping
from functools import lru_cache
from importlib.metadata import entry_points

from truth.effects import CATALOGUE, RIVALS, Draw
from truth.effects.outside import OUTSIDE
from truth.errors import TruthError

GROUP = "mbw.truth_effects"


@lru_cache(maxsize=1)
def known_effects() -> Mapping[str, Draw]:
    """Return all effects by name: of the catalogue, its rivals, outside it, of other packages.

    Raises:
        TruthError: an entry point cannot be loaded, or has a name that is taken.
    """
    effects: dict[str, Draw] = {**CATALOGUE, **RIVALS, **OUTSIDE}
    for point in entry_points(group=GROUP):
        if point.name in effects:
            raise TruthError(f"entry point {point.name} of {GROUP}: the name is taken; rename it")
        try:
            draw = point.load()
        except Exception as error:
            raise TruthError(
                f"entry point {point.name} of {GROUP}: loading {point.value} fails ({error}); "
                "mend it or uninstall its package"
            ) from error
        if not callable(draw):
            raise TruthError(f"entry point {point.name} of {GROUP}: name a function that draws it")
        effects[point.name] = draw
    return effects
