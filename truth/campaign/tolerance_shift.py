"""Effects on what has a tolerance: how many standard deviations they shift it.

A diagnosis proposes such an effect as the release of its tolerance. Where a campaign states none,
it proposes nothing there.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from truth.campaign.draw import Tolerances
from truth.effects import Effect
from truth.effects.effect import stated_number


@dataclass(frozen=True)
class ToleranceShift:
    """Shift of tolerances by an effect.

    Args:
        count: number of the tolerances; 0 of an effect on what has none.
        per_size: standard deviations per unit of the size of the effect.
    """

    count: int = 0
    per_size: float = 0.0


@dataclass(frozen=True)
class _Shifted:
    """What an effect shifts.

    Args:
        tolerance: its field.
        count: its numbers.
        parameter: of the answer.
        unchanged: that parameter without the effect.
    """

    tolerance: str
    count: int
    parameter: str
    unchanged: float = 0.0


_SHIFTED: Mapping[str, _Shifted] = {
    "sensor_gain": _Shifted("sensor_gain", 1, "gain", 1.0),
    "sensor_misalignment": _Shifted("sensor_angle", 3, "rotation"),
    "sensor_position": _Shifted("sensor_position", 3, "offset"),
    "sensor_delay": _Shifted("sensor_delay", 3, "delay"),
    "hammer_gain": _Shifted("hammer_gain", 1, "gain", 1.0),
    "hammer_misalignment": _Shifted("hammer_angle", 2, "rotation"),
    "hammer_position": _Shifted("hammer_position", 3, "offset"),
    "hammer_delay": _Shifted("hammer_delay", 1, "delay"),
}


def list_without_tolerance(tolerance: Tolerances) -> dict[str, str]:
    """Return the effects on what has no tolerance, which no diagnosis proposes, with its field."""
    return {
        effect: shifted.tolerance
        for effect, shifted in _SHIFTED.items()
        if not getattr(tolerance, shifted.tolerance)
    }


def shift_of(effect: Effect, tolerance: Tolerances) -> ToleranceShift:
    """Return how an effect shifts tolerances.

    Args:
        effect: as it is drawn.
        tolerance: standard deviations of the priors.
    """
    answer = effect.answer()
    shifted = _SHIFTED.get(answer.effect)
    if shifted is None or effect.size is None:
        return ToleranceShift()
    value = stated_number(shifted.parameter, answer.parameters[shifted.parameter])
    deviation = getattr(tolerance, shifted.tolerance)
    return ToleranceShift(shifted.count, abs(value - shifted.unchanged) / deviation / effect.size)
