r"""The smallest size of each effect that a diagnosis finds in nine tests of ten, predicted.

A diagnosis whose posterior weighs the gain g of a fit by kappa finds an effect if it is the most
probable of M hypotheses, and more probable than that nothing is missing. With noise a gain of g has
the standard deviation sqrt(2 g), so that nine of ten gains are at least g - 1.28 sqrt(2 g) =: q(g).
The size is the smallest at which

    kappa q(g) >= ln M + ln[1 + (hidden N / g)^(1 / width)],
    sum_F exp(-kappa q(g sin^2_F)) <= 1,   sqrt(2 g) without bounds >= 4.5 + 1.28,

the second over all other families F of effect and place: g sin^2_F is what a fit with F, in any of
its shapes, leaves of the gain. ``hidden`` is the gap per value that badly known noise may hide. The
third leaves tolerances alone that are off by up to 4.5 standard deviations: they are no effect.
Where a tolerance is at its bound, its own error shifts the size by 1.28 standard deviations.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from truth.campaign.bounded_least_squares import BOUND
from truth.campaign.signatures import Information, Signature, families, gram_matrix
from truth.effects.effect import Effect, stated_number
from truth.machine.station import Real

_NINE_OF_TEN = 1.2815515655446004  # standard deviations below which one in ten lies
_CONFUSED = 0.9  # cosine from which two signatures are confounded, as in a verdict
_RIDGE = 1e-9  # of the Gram matrix of a family's shapes, relative
_HALVINGS = 60  # of the interval of ln g
_SIZE_HALVINGS = 12  # of the interval of the logarithm of a size
OUTLIER_SIGMA = 4.5  # standard deviations up to which a tolerance is no effect
_GAINS = (1e-2, 1e12)  # nats, between which g is looked for


@dataclass(frozen=True)
class Weighing:
    """How a diagnosis weighs gains.

    Args:
        weight: kappa, of a nat of the fit in the odds.
        hidden: gap per value that badly known noise may hide.
        hidden_width: width of its odds.
        values: number N of complex values of the test.
    """

    weight: float
    hidden: float
    hidden_width: float
    values: int


@dataclass(frozen=True)
class SmallestSize:
    """The smallest size of an effect at a place that nine tests of ten show.

    Args:
        effect: its name.
        location: as in an answer.
        dof: as in an answer; empty without one.
        parameter: of the answer by which the size is stated; empty if no parameter follows the
            size, or the effect has none.
        value: of that parameter at the smallest size, the largest over the shapes; None where no
            plausible size is found, or without such a parameter.
        of_usual: that size over the one that is usually drawn; None without a size.
        is_found: whether a plausible size is found.
        gain: gain in log likelihood at that size, or without a size at the effect itself [nats].
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
    signatures: Sequence[Signature], information: Information, weighing: Weighing
) -> list[SmallestSize]:
    """Return the smallest size for every effect, place and direction.

    Args:
        signatures: of all effects and places that compete.
        information: of the whole test.
        weighing: how the diagnosis weighs gains.
    """
    gram = gram_matrix(signatures)
    groups = list(families(signatures))
    found = []
    for family, numbers in groups:
        rivals = [(name, row) for name, row in groups if name[:2] != family[:2]]
        rows = [
            _one_shape(signatures[number], information, _shares(gram, number, rivals), weighing)
            for number in numbers
        ]
        found.append(max(rows, key=lambda row: (not row.is_found, row.of_usual or 0.0)))
    return found


def needed_gain(weighing: Weighing, hypotheses: int, shares: Real) -> float:
    """Return the smallest g that nine tests of ten tell from nothing and from all rivals [nats].

    Args:
        weighing: how the diagnosis weighs gains.
        hypotheses: their number M.
        shares: cos^2 of each rival; (n_rival,).
    """

    def is_enough(gain: float) -> bool:
        nothing = (weighing.hidden * weighing.values / gain) ** (1 / weighing.hidden_width)
        prior = np.log(hypotheses) + np.log1p(nothing)
        left = gain * np.maximum(1 - shares, 0.0)
        odds = np.exp(-weighing.weight * _in_nine_of_ten(left))
        return bool(weighing.weight * _in_nine_of_ten(gain) >= prior and odds.sum() <= 1)

    return _first(is_enough)


def _in_nine_of_ten(gain: Real | float) -> Real:
    """Return the gain that nine tests of ten exceed; not below 0."""
    sure: Real = np.asarray(gain - _NINE_OF_TEN * np.sqrt(2 * np.asarray(gain)))
    return np.where(sure > 0, sure, 0.0)


def _first(is_enough: Callable[[float], bool]) -> float:
    """Return the smallest gain that is enough, by halving; infinite if none is."""
    low, high = np.log(_GAINS)
    if not is_enough(float(np.exp(high))):
        return np.inf
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if is_enough(float(np.exp(middle))) else (middle, high)
    return float(np.exp(high))


def _shares(
    gram: Real, number: int, rivals: Sequence[tuple[tuple[str, str, str], list[int]]]
) -> dict[tuple[str, str, str], float]:
    """Return cos^2 of each rival family with one signature."""
    gain = max(float(gram[number, number]), 1e-300)
    return {name: min(_explained(gram, number, row) / gain, 1.0) for name, row in rivals}


def _one_shape(
    signature: Signature,
    information: Information,
    shares: Mapping[tuple[str, str, str], float],
    weighing: Weighing,
) -> SmallestSize:
    """Return the smallest size of one shape.

    Args:
        signature: of the shape.
        information: of the whole test.
        shares: cos^2 of each rival family.
        weighing: how the diagnosis weighs gains.
    """
    limit = np.array(list(shares.values()))
    needed = needed_gain(weighing, len(shares) + 1, limit)
    per_size = max(float(signature.left @ signature.left), 1e-300)
    no_outlier = (OUTLIER_SIGMA + _NINE_OF_TEN) / float(np.sqrt(2 * per_size))
    confused = tuple(
        dict.fromkeys(
            f"{name[0]}@{name[1]}" for name, share in shares.items() if share >= _CONFUSED**2
        )
    )
    drawn = signature.drawn
    if drawn.size is None or drawn.limits is None:
        gain = information.gain(signature, 1.0)
        is_found = gain >= needed and no_outlier <= 1.0
        return SmallestSize(*signature.family, "", None, None, is_found, gain, confused)
    largest = drawn.limits[1]
    if no_outlier > largest or _sure_gain(information, signature, largest) < needed:
        return SmallestSize(*signature.family, "", None, None, False, needed, confused)
    low, high = np.log(max(no_outlier, drawn.limits[0])), np.log(largest)
    if _sure_gain(information, signature, float(np.exp(low))) >= needed:
        high = low
    for _ in range(_SIZE_HALVINGS if high > low else 0):
        middle = (low + high) / 2
        is_enough = _sure_gain(information, signature, float(np.exp(middle))) >= needed
        low, high = (low, middle) if is_enough else (middle, high)
    size = float(np.exp(high))
    parameter, value = _stated(drawn, size)
    of_usual = size / drawn.size
    return SmallestSize(*signature.family, parameter, value, of_usual, True, needed, confused)


def _sure_gain(information: Information, signature: Signature, size: float) -> float:
    """Return the gain of a size that nine tests of ten have, where tolerances are at their bounds.

    A tolerance's own error is a standard deviation of 1 along x, which is 1 / |x| of the size.
    """
    along = signature.followed[information.bounded]
    if size * np.abs(along).max(initial=0.0) > BOUND:
        size = max(size - _NINE_OF_TEN / float(np.linalg.norm(along)), 0.0)
    return information.gain(signature, size)


def _explained(gram: Real, number: int, row: Sequence[int]) -> float:
    """Return the gain of a fit with a family, in any of its shapes, instead of the effect."""
    block = gram[np.ix_(row, row)]
    size = np.sqrt(np.maximum(np.diag(block), 1e-300))
    unit = block / np.outer(size, size) + _RIDGE * np.eye(len(row))
    along = gram[number, row] / size
    return float(along @ np.linalg.solve(unit, along))


def _stated(drawn: Effect, size: float) -> tuple[str, float | None]:
    """Return the first parameter of an answer that a size changes.

    The participation of a flexible body, for example, is no parameter: then there is none.
    """
    at_size, at_half = (drawn.sized(part * size).answer().parameters for part in (1.0, 0.5))
    for name, value in at_size.items():
        if not np.array_equal(np.asarray(value), np.asarray(at_half[name])):
            return name, stated_number(name, value)
    return "", None
