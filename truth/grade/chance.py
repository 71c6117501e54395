r"""What pure chance would score, exactly.

The guesser draws an effect, all alike, then one of its places, all alike: p = 1 / (number of
effects x number of the effect's places). It knows what may sit where, and never says none. The
three most probable are drawn one after the other, none twice; one of a set A is among them with

    1 - sum_{i,j} p_i p_j / (1 - p_i) (S - p_i - p_j) / (1 - p_i - p_j),

i and j different and outside A, S the sum outside A. Probabilities are stated as they are drawn.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from truth.grade.answer import Truth
from truth.grade.marks import FLOOR, NO_EXCESS, Excess, Marks, marks_of
from truth.grade.names import canonical
from truth.grade.verdict import EXPLAINED, StatedVerdict
from truth.machine.station import Real

Hypotheses = Mapping[str, Sequence[str]]  # places by effect


def chance_marks(truth: Truth, hypotheses: Hypotheses, excess: Excess = NO_EXCESS) -> Marks:
    """Return the expected marks of the guesser.

    Args:
        truth: what the machine has.
        hypotheses: the places that each effect may have; none of them empty.
        excess: as in ``marks_of``; what is guessed has no size and closes nothing.
    """
    drawn = {
        (effect, canonical(place)): 1 / (len(hypotheses) * len(places))
        for effect, places in hypotheses.items()
        for place in places
    }
    labels, chances = list(drawn), np.array(list(drawn.values()))
    # A verdict without causes has every mark that cannot depend on what is drawn.
    marks = dict(marks_of(truth, StatedVerdict(EXPLAINED), excess))
    marks |= {"verdict_is_first": 1.0, "twin_set": 1.0, "places": 1.0, "direction": None}
    marks |= _where(truth, drawn)
    true = [labels.index(label) for label in _labels(truth) if label in drawn]
    on_truth, top = 0.0, 0.0
    only = truth.only
    if only is not None:
        same = sum(p for (effect, _), p in drawn.items() if effect == only.effect)
        marks |= {"effect_first": same, "effect_or_twin": same}
        if true:
            on_truth, top = float(chances[true[0]]), among_three(chances, true)
        marks |= {"both": on_truth, "both_or_twin": on_truth, "top3": top}
    elif marks["largest_first"] is not None:
        first = truth.causes[0]
        marks["largest_first"] = drawn.get((first.effect, first.location), 0.0)
    marks["probability_of_truth"] = on_truth
    marks["brier"] = float((chances**2).sum()) - 2 * on_truth + 1
    marks["log_score"] = -math.log(max(on_truth, FLOOR))
    return marks


def among_three(chances: Real, wanted: list[int]) -> float:
    """Return the probability that one of the wanted is among three drawn of (n,), none twice."""
    unwanted = np.delete(chances, wanted)
    pairs = unwanted[:, None] + unwanted
    rest = 1 - pairs
    np.fill_diagonal(rest, 1.0)
    missed = (unwanted / (1 - unwanted))[:, None] * unwanted * (unwanted.sum() - pairs) / rest
    np.fill_diagonal(missed, 0.0)
    return float(1 - missed.sum())


def _labels(truth: Truth) -> list[tuple[str, str]]:
    return [(cause.effect, cause.location) for cause in truth.causes]


def _where(truth: Truth, drawn: Mapping[tuple[str, str], float]) -> dict[str, float | None]:
    """Return marks of places, drawn as the effects that sit there are."""
    if not truth.places:
        return {}
    by_place: dict[str, float] = {}
    for (_, place), chance in drawn.items():
        by_place[place] = by_place.get(place, 0.0) + chance
    chances = np.array(list(by_place.values()))
    true = [number for number, place in enumerate(by_place) if place in truth.places]
    first = float(chances[true].sum())
    top = among_three(chances, true) if true else 0.0
    return {"place_first": first, "where_first": first, "where_top3": top}
