"""How large an effect is beside the sizes that are usually drawn."""

import numpy as np

from truth.campaign.cause import size_by_parameter
from truth.campaign.place_names import OwnTest, find_place, named_direction
from truth.campaign.protocol import occasions, takes
from truth.effects import Scene
from truth.effects.other_packages import known_effects
from truth.errors import TruthError
from truth.machine.station import Station
from truth.random_streams import stream

_USUAL_DRAWS = 12  # draws of a place, direction and sign: their mean is known to a fifth
_MAX_DRAWS = 120  # draws until so many are of the direction and sign


def compare_with_usual(
    station: Station,
    test: OwnTest,
    cause: tuple[str, str, str],
    parameter: tuple[str, float],
) -> float | None:
    """Return the size of an effect over the one that is usually drawn.

    Args:
        station: the nominal machine.
        test: how it is tested.
        cause: effect, place and direction, with the model's own names of sites.
        parameter: name and value of a parameter of the answer that follows the size.

    Returns:
        Geometric mean over draws; infinite if none can be as large, None if none is drawn there.
    """
    effect, location, dof = cause
    protocol, place = test.protocol, find_place(location, station)
    scene = Scene(station, occasions(protocol, takes(protocol, station, 0)), protocol.pace)
    ratios: dict[str, list[float]] = {}
    for number in range(_MAX_DRAWS):
        try:
            drawn = known_effects()[effect](stream(number, f"usual.{place}"), scene, place)
            if drawn is None or drawn.size is None:
                return None
            sized = size_by_parameter(drawn, *parameter)
        except TruthError:
            return None
        towards = named_direction(drawn.answer().dof, station)
        # A cause without a direction may be drawn in any.
        of_direction = ratios.setdefault(towards if dof else "", [])
        of_direction += [] if sized is None or sized.size is None else [sized.size / drawn.size]
        if len(ratios.get(dof, ())) == _USUAL_DRAWS:
            break
    if dof not in ratios:
        return None
    return float(np.exp(np.mean(np.log(ratios[dof])))) if ratios[dof] else float(np.inf)
