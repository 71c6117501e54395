"""The smallest size of each effect that a diagnosis finds in nine tests of ten, predicted.

For each draw of noise, tolerances, direction and shape, the size is halved in until the linearised
verdict (``linear_verdicts``) just names the effect. Nine tenths of these sizes are smaller than the
one that is stated.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from truth.campaign.choice import WHOLE_DECK, Choice
from truth.campaign.linear_verdicts import Family, LinearVerdicts
from truth.campaign.place_names import named_direction, named_place
from truth.campaign.signatures import Information, Signature
from truth.campaign.weighing import Weighing
from truth.effects.effect import Effect, stated_number
from truth.machine.station import Real, Station

NINE_OF_TEN = 0.9
_CONFUSED = 0.9  # cosine from which two signatures are confounded, as in a verdict
_SIZE_HALVINGS = 14  # of the interval of the logarithm of a size


@dataclass(frozen=True)
class SmallestSize:
    """The smallest size of an effect at a place that nine tests of ten show.

    Args:
        effect: its name.
        location: as in an answer.
        dof: as in an answer; empty without one.
        parameter: of the answer by which the size is stated; empty if no parameter follows the
            size, or the effect has none.
        value: of that parameter at the smallest size; None where no plausible size is found, or
            without such a parameter.
        of_usual: that size over the one that is usually drawn; None without a size.
        is_found: whether a plausible size is found.
        gain: median gain in log likelihood of a fit at that size, or without a size at the effect
            itself or its largest size [nats].
        confused: effects and places with a cosine of at least 0.9.
    """

    effect: str
    location: str
    dof: str
    parameter: str
    value: float | None
    of_usual: float | None
    is_found: bool
    gain: float
    confused: tuple[str, ...]


def predict_smallest(
    signatures: Sequence[Signature],
    information: Information,
    weighing: Weighing,
    choice: Choice = WHOLE_DECK,
) -> list[SmallestSize]:
    """Return the smallest size for every effect, place and direction of a choice.

    Args:
        signatures: of all effects and places that compete.
        information: of the lines that a fit sees.
        weighing: how the diagnosis weighs fits.
        choice: effects and places; empty for all.
    """
    verdicts = LinearVerdicts(signatures, information, weighing)
    return [
        _predict(verdicts, family, numbers)
        for family, numbers in verdicts.families
        if (not choice.effects or family[0] in choice.effects)
        and (not choice.places or family[1] in choice.places)
    ]


def named_size(row: SmallestSize, station: Station) -> SmallestSize:
    """Return a smallest size with the model's own names of sites."""
    pairs = (name.partition("@") for name in row.confused)
    return replace(
        row,
        location=named_place(row.location, station),
        dof=named_direction(row.dof, station),
        confused=tuple(f"{effect}@{named_place(place, station)}" for effect, _, place in pairs),
    )


def find_thresholds(
    verdicts: LinearVerdicts, numbers: Sequence[int], limits: tuple[float, float]
) -> Real:
    """Return the size from which an effect is found in each draw; infinite if none is.

    Args:
        verdicts: draws of the test.
        numbers: of the signatures of a family.
        limits: smallest and largest size.
    """
    low, high = (np.full(verdicts.draws, np.log(limit)) for limit in limits)
    is_found_ever = verdicts.find(numbers, np.exp(high))
    for _ in range(_SIZE_HALVINGS):
        middle = (low + high) / 2
        is_found = verdicts.find(numbers, np.exp(middle))
        low, high = np.where(is_found, low, middle), np.where(is_found, middle, high)
    return np.where(is_found_ever, np.exp(high), np.inf)


def _predict(verdicts: LinearVerdicts, family: Family, numbers: Sequence[int]) -> SmallestSize:
    """Return the smallest size of one effect, place and direction, over all its shapes."""
    drawn = [verdicts.signatures[number].drawn for number in numbers]
    confused = _find_confused(verdicts, family, numbers)
    limits, usual = drawn[0].limits, [effect.size for effect in drawn if effect.size is not None]
    if limits is None or not usual:
        rate = np.mean(verdicts.find(numbers, np.ones(verdicts.draws)))
        gain = _median_gain(verdicts, numbers, 1.0)
        return SmallestSize(*family, "", None, None, bool(rate >= NINE_OF_TEN), gain, confused)
    sizes = find_thresholds(verdicts, numbers, limits)
    size = float(np.quantile(sizes, NINE_OF_TEN, method="higher"))
    if not np.isfinite(size):
        gain = _median_gain(verdicts, numbers, limits[1])
        return SmallestSize(*family, "", None, None, False, gain, confused)
    parameter, value = _state_size(drawn[0], size)
    of_usual = size / float(np.exp(np.mean(np.log(usual))))
    gain = _median_gain(verdicts, numbers, size)
    return SmallestSize(*family, parameter, value, of_usual, True, gain, confused)


def _median_gain(verdicts: LinearVerdicts, numbers: Sequence[int], size: float) -> float:
    """Return the median gain of a fit with an effect of one size [nats]."""
    return float(np.median(verdicts.gain(numbers, np.full(verdicts.draws, size))))


def _find_confused(
    verdicts: LinearVerdicts, family: Family, numbers: Sequence[int]
) -> tuple[str, ...]:
    """Return effects and places whose shapes explain nearly all of one shape of a family."""
    shares = np.max([verdicts.shares(number) for number in numbers], axis=0)
    names = [
        f"{name[0]}@{name[1]}"
        for (name, _), share in zip(verdicts.families, shares, strict=True)
        if share >= _CONFUSED**2 and name[:2] != family[:2]
    ]
    return tuple(dict.fromkeys(names))


def _state_size(drawn: Effect, size: float) -> tuple[str, float | None]:
    """Return the first parameter of an answer that a size changes.

    The participation of a flexible body, for example, is no parameter: then there is none.
    """
    at_size, at_half = (drawn.sized(part * size).answer().parameters for part in (1.0, 0.5))
    for name, value in at_size.items():
        if not np.array_equal(np.asarray(value), np.asarray(at_half[name])):
            return name, stated_number(name, value)
    return "", None
