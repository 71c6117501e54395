r"""The grader: what an answer has right of a case whose truth is known.

A stated cause is *right* if effect and place are. Its place credit is the mean over the places
that it names: 1 for the true one and for each that the test cannot tell from it, 1/2 for a
neighbour, 0 for any other. A place is right if the truth is among those named and the credit is at
least 1/2. Small imperfections that the machine has beside its causes are neither right nor wrong.

The most probable hypothesis of an answer has these marks, each from 0 to 1:

* ``right``: it is the truth, no cause too many and none too few;
* ``effect``, ``place``, ``set``: sum over matched causes, divided by the number of true or stated
  causes, whichever is larger: of effects that are right, of place credit, and of causes that are
  right;
* ``size``: of a right cause, |stated - true| <= 0.1 |true - neutral|; ``inside``: its interval
  holds the true size; the shares of all right causes that have a size, and an interval;
* ``shrink``: 1 - (e_after / e_before)^2 of the excess that the entry states, 0 unless it is right.

Of all hypotheses, with the probability p of those that are the truth:

* ``log``: -ln max(p, 0.001), ``brier``: (1 - p)^2 + the sum of squares of all others;
* ``wrong``: a cause with a probability of at least 1/2 that is not there;
* ``false_alarm``: of a machine that lacks nothing: the most probable hypothesis is wrong.

Beside small imperfections alone, ``unexplained`` is as true as ``none``.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from gapbench.answer import EntryAnswer, Stated

Key: TypeAlias = Mapping[str, Any]  # of a case in keys.json, or of one of its causes
Marks: TypeAlias = dict[str, float | None]

MIN_PROBABILITY = 1e-3  # below it the log score looks no further
NAMED = 0.5  # probability from which a cause counts as named
SIZE_ERROR = 0.1
NEIGHBOUR_CREDIT = 0.5
MARKS = ("right", "effect", "place", "set", "size", "inside", "shrink", "log", "brier", "wrong")


def place_credit(stated: Stated, true: Key) -> float:
    """Return the mean credit of the places that a cause names."""
    same, near = {*true["places"], *true["alike"]}, set(true["near"])
    shares = [
        1.0 if place in same else NEIGHBOUR_CREDIT * (place in near) for place in stated.places
    ]
    return float(np.mean(shares))


def is_right(stated: Stated, true: Key) -> bool:
    """Tell whether effect and place of a cause are those of a true one."""
    same = {*true["places"], *true["alike"]}
    is_there = not same.isdisjoint(stated.places)
    return stated.effect == true["effect"] and is_there and place_credit(stated, true) >= 0.5


def is_background(stated: Stated, key: Key) -> bool:
    """Tell whether a cause is a small imperfection that the machine has."""
    return any([stated.effect, place] in key["background"] for place in stated.places)


def grade(answer: EntryAnswer, key: Key) -> Marks:
    """Return the marks of an answer.

    Args:
        answer: what an entry says.
        key: the case's entry in ``keys.json``.

    Returns:
        By the names of ``MARKS`` and ``false_alarm``; None where a mark is not asked.
    """
    kind, causes = answer.top()
    true: Sequence[Key] = key["causes"]
    named = _without_background(causes, key)
    pairs = _match(named, true)
    n_right = sum(is_right(*pair) for pair in pairs)
    right = _is_truth(kind, causes, key)
    marks: Marks = dict.fromkeys((*MARKS, "false_alarm"))
    marks["right"] = float(right)
    if true:
        most = max(len(true), len(named))
        marks["effect"] = sum(said.effect == cause["effect"] for said, cause in pairs) / most
        marks["place"] = sum(place_credit(*pair) for pair in pairs) / most
        marks["set"] = n_right / most
        before, after = answer.gap or (0.0, 0.0)
        is_less = right and before > 0
        marks["shrink"] = max(0.0, 1 - (after / before) ** 2) if is_less else 0.0
        marks |= _size_marks([pair for pair in pairs if is_right(*pair)])
    else:
        marks["false_alarm"] = float(not right)
    judged = [(answer.none, _is_truth("none", (), key))]
    judged += [(answer.unexplained, _is_truth("unexplained", (), key))]
    judged += [(probability, _is_truth("set", stated, key)) for probability, stated in answer.sets]
    on_truth = math.fsum(probability for probability, is_true in judged if is_true)
    untrue = [probability for probability, is_true in judged if not is_true]
    marks["log"] = -math.log(max(on_truth, MIN_PROBABILITY))
    marks["brier"] = (1 - on_truth) ** 2 + math.fsum(p**2 for p in untrue)
    marks["wrong"] = float(_names_wrong_cause(answer, key))
    return marks


def _is_truth(kind: str, causes: Sequence[Stated], key: Key) -> bool:
    """Tell whether a hypothesis is the truth: none, unexplained or a set of causes."""
    true, named = key["causes"], _without_background(causes, key)
    if kind != "set":
        as_true = {"none"} | ({"unexplained"} if key["background"] else set())
        return not true and kind in as_true
    n_right = sum(is_right(*pair) for pair in _match(named, true))
    return n_right == len(true) == len(named)


def _without_background(causes: Sequence[Stated], key: Key) -> list[Stated]:
    """Return the causes that are not small imperfections of the machine."""
    return [
        cause
        for cause in causes
        if any(is_right(cause, true) for true in key["causes"]) or not is_background(cause, key)
    ]


def _match(named: Sequence[Stated], true: Sequence[Key]) -> list[tuple[Stated, Key]]:
    """Pair stated with true causes, those that fit best first; each is used once."""
    order = sorted(
        ((i, k) for i in range(len(named)) for k in range(len(true))),
        key=lambda pair: (
            -is_right(named[pair[0]], true[pair[1]]),
            -(named[pair[0]].effect == true[pair[1]]["effect"]),
            -place_credit(named[pair[0]], true[pair[1]]),
        ),
    )
    pairs: list[tuple[int, int]] = []
    for i, k in order:
        if all(i != first and k != second for first, second in pairs):
            pairs.append((i, k))
    return [(named[i], true[k]) for i, k in pairs]


def _size_marks(pairs: Sequence[tuple[Stated, Key]]) -> Marks:
    """Return shares of sizes within 10 %, and of intervals that hold the truth."""
    sized = [(said, true["size"], true["neutral"]) for said, true in pairs if true["size"]]
    near = [
        said.size is not None and abs(said.size - size) <= SIZE_ERROR * abs(size - neutral)
        for said, size, neutral in sized
    ]
    inside = [
        said.interval[0] <= size <= said.interval[1] for said, size, _ in sized if said.interval
    ]
    return {
        "size": float(np.mean(near)) if near else None,
        "inside": float(np.mean(inside)) if inside else None,
    }


def _names_wrong_cause(answer: EntryAnswer, key: Key) -> bool:
    """Tell whether a cause that is not there has a probability of at least one half."""
    presence: dict[tuple[str, str], float] = {}
    for probability, causes in answer.sets:
        for cause in causes:
            if any(is_right(cause, true) for true in key["causes"]) or is_background(cause, key):
                continue
            name = (cause.effect, cause.places[0])
            presence[name] = presence.get(name, 0.0) + probability
    return any(probability >= NAMED for probability in presence.values())
