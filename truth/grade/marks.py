"""The marks of one case: what a verdict has right, each from 0 to 1, None where it is not asked.

Every verdict goes through here, a baseline's like the software's. One that could not be read is
wrong wherever a mark is asked; as a false alarm it counts, too.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from truth.grade.answer import TrueCause, Truth
from truth.grade.verdict import (
    FAILED,
    NONE,
    PARTLY,
    SEVERAL,
    UNEXPLAINED,
    First,
    Row,
    StatedVerdict,
    alone,
    first_of,
    is_word_of,
    twins_of,
)

FLOOR = 1e-3  # probability below which the log score looks no further
SEEN = 1.1  # excess from which a gap is one
_TOP = 3

RATES: Mapping[str, str] = MappingProxyType(
    {
        "effect_first": "the most probable hypothesis names the true effect",
        "effect_or_twin": "the same, or the truth is in one set of twins with it",
        "place_first": "its place, or one that the test cannot tell from it, is the true one (of "
        "several: one of them)",
        "both": "effect and place of it are true",
        "both_or_twin": "the same, or the truth is in one set of twins with it",
        "top3": "one effect: it is among the three most probable causes, at its place",
        "direction": "of those with both, if the truth has a direction: it is the true one",
        "verdict_is_first": "the word of the verdict fits its most probable hypothesis",
        "false_alarm": "nothing wrong, or stiffness and damping alone: the verdict, or its most "
        "probable hypothesis, is not none",
        "unknown_rejected": "outside the catalogue: verdict and first hypothesis are unexplained",
        "unknown_placed": "of those rejected: most of the gap is seen at the true place",
        "several_said": "several effects: the verdict is several, or partly with two causes",
        "both_found": "two effects: several is said so, the two most probable causes are they",
        "largest_first": "several effects: the most probable cause is the largest",
        "where_first": "most of the gap is seen at the true place",
        "where_top3": "the true place is among the three with most of the gap",
    }
)
MEANS: Mapping[str, str] = MappingProxyType(
    {
        "probability_of_truth": "probability of the true hypothesis",
        "brier": "sum over all hypotheses of (probability - 1 if true, else 0)^2; 0 to 2",
        "log_score": f"-ln(probability of the truth), at most -ln({FLOOR:g})",
        "twin_set": "size of the set of twins of the first cause, itself included",
        "places": "number of places of the first cause that the test cannot tell apart",
        "shrink_share": "shrink of excess^2 by the verdict's cause over that by the true one",
    }
)
Marks = Mapping[str, float | None]


@dataclass(frozen=True)
class Excess:
    """Held-out excess of the command's own refits, without and with knowledge of the effect.

    None where the refit was not made.
    """

    refit: float | None = None
    oracle: float | None = None


NO_EXCESS = Excess()


def marks_of(truth: Truth, verdict: StatedVerdict, excess: Excess = NO_EXCESS) -> Marks:
    """Return all marks of ``RATES`` and ``MEANS``, each by its name."""
    first = first_of(verdict)
    marks: dict[str, float | None] = {
        **_of_first(truth, verdict, first),
        **_of_kind(truth, verdict, first),
        **_of_where(truth, verdict),
        **_of_probability(truth, verdict),
    }
    fits = verdict.verdict != FAILED and is_word_of(verdict.verdict, first)
    marks["verdict_is_first"] = float(fits)
    marks["twin_set"] = float(len(twins_of(verdict, first.row))) if first.row else None
    marks["places"] = float(len(first.places)) if first.row else None
    marks["shrink_share"] = shrink_share(verdict, excess)
    return MappingProxyType(marks)


def is_true(truth: Truth, first: First) -> bool:
    """Tell whether a hypothesis is the truth: the effect, of a cause its place too."""
    if first.row is not None:
        return _is_at(truth.only, first.row)
    return first.effect == truth.effect


def is_present(truth: Truth, row: Row) -> bool:
    """Tell whether a machine has a cause, alone or among several."""
    return any(_is_at(cause, row) for cause in truth.causes)


def shrink_share(verdict: StatedVerdict, excess: Excess) -> float | None:
    """Return (refit^2 - after^2) over (refit^2 - oracle^2), 0 to 1; 0 without a cause.

    Both refits are the command's; of the verdict only what is left after its cause counts. None
    unless both were made, there was a gap, and the true effect made it smaller.
    """
    refit, oracle = excess.refit, excess.oracle
    if refit is None or oracle is None or refit < SEEN or refit <= oracle:
        return None
    if verdict.after is None:
        return 0.0
    share = (refit**2 - verdict.after**2) / (refit**2 - oracle**2)
    return min(max(share, 0.0), 1.0)


def _is_at(cause: TrueCause | None, row: Row) -> bool:
    return cause is not None and row.is_at(cause.effect, cause.location)


def _of_first(truth: Truth, verdict: StatedVerdict, first: First) -> dict[str, float | None]:
    effect = first.effect == truth.effect
    place = not set(first.places).isdisjoint(truth.places)
    both = effect and (place or not truth.places)
    only = truth.only
    twin = bool(only and first.row and (only.effect, only.location) in twins_of(verdict, first.row))
    top = None
    if only is not None:
        top = float(any(_is_at(only, row) for row in verdict.causes[:_TOP]))
    direction = None
    if both and only is not None and only.dof and first.row is not None:
        direction = float(first.row.dof == only.dof)
    return {
        "effect_first": float(effect),
        "effect_or_twin": float(effect or twin),
        "place_first": float(place) if truth.places else None,
        "both": float(both),
        "both_or_twin": float(both or twin),
        "top3": top,
        "direction": direction,
    }


def _of_kind(truth: Truth, verdict: StatedVerdict, first: First) -> dict[str, float | None]:
    marks: dict[str, float | None] = dict.fromkeys(
        (
            "false_alarm",
            "unknown_rejected",
            "unknown_placed",
            "several_said",
            "both_found",
            "largest_first",
        )
    )
    if truth.effect == NONE:
        marks["false_alarm"] = float(not verdict.verdict == first.effect == NONE)
    elif truth.effect == UNEXPLAINED:
        rejected = verdict.verdict == first.effect == UNEXPLAINED
        marks["unknown_rejected"] = float(rejected)
        if rejected and truth.places:
            most = verdict.where[0][0] if verdict.where else ""
            marks["unknown_placed"] = float(most in truth.places)
    elif truth.effect == SEVERAL:
        said = verdict.verdict == SEVERAL or (
            verdict.verdict == PARTLY and sum(row.probability >= 0.5 for row in verdict.causes) > 1
        )
        marks["several_said"] = float(said)
        known = [cause for cause in truth.causes if cause.effect != UNEXPLAINED]
        if len(known) == len(truth.causes) == 2:
            two = verdict.causes[:2]
            both = len(two) == 2 and all(any(_is_at(cause, row) for row in two) for cause in known)
            marks["both_found"] = float(said and both)
        if truth.causes[0] in known:
            marks["largest_first"] = float(
                any(_is_at(truth.causes[0], row) for row in verdict.causes[:1])
            )
    return marks


def _of_where(truth: Truth, verdict: StatedVerdict) -> dict[str, float | None]:
    if not truth.places:
        return {"where_first": None, "where_top3": None}
    seen = [place for place, _ in verdict.where or ()]
    return {
        "where_first": float(any(place in truth.places for place in seen[:1])),
        "where_top3": float(any(place in truth.places for place in seen[:_TOP])),
    }


def _of_probability(truth: Truth, verdict: StatedVerdict) -> dict[str, float | None]:
    stated = [
        (verdict.none, truth.effect == NONE),
        (verdict.unexplained, truth.effect == UNEXPLAINED),
        (verdict.several, truth.effect == SEVERAL),
    ]
    stated += [
        (probability, _is_at(truth.only, row))
        for row, probability in zip(verdict.causes, alone(verdict), strict=True)
    ]
    on_truth = math.fsum(probability for probability, true in stated if true)
    brier = math.fsum((probability - true) ** 2 for probability, true in stated)
    if not any(true for _, true in stated):
        brier += 1.0
    return {
        "probability_of_truth": on_truth,
        "brier": 2.0 if verdict.verdict == FAILED else brier,
        "log_score": -math.log(max(on_truth, FLOOR)),
    }
