"""The answer of an entry: hypotheses with probabilities, each a set of causes."""

import json
import math
from dataclasses import dataclass

_MOST_CAUSES = 6  # of a set; more would name everything
_SUM_ERROR = 1e-6  # by which probabilities may sum to more than 1


class AnswerError(ValueError):
    """An answer breaks the format; the message says where."""


@dataclass(frozen=True)
class Stated:
    """A cause as an entry states it.

    Args:
        effect: name, as in ``keys.json``.
        places: where it sits, or all places that the entry cannot tell apart.
        size: in the unit of the effect's size; None if it is not stated.
        interval: 95 % interval of the size; None if it is not stated.
    """

    effect: str
    places: tuple[str, ...]
    size: float | None = None
    interval: tuple[float, float] | None = None


@dataclass(frozen=True)
class EntryAnswer:
    """All that an entry says of a campaign.

    Args:
        none: probability that the model lacks nothing.
        unexplained: probability that it lacks something that no set names.
        sets: probability and causes of each set, the most probable first.
        gap: excess of the re-tuned model without and with the most probable set; None if not
            stated.
    """

    none: float = 0.0
    unexplained: float = 0.0
    sets: tuple[tuple[float, tuple[Stated, ...]], ...] = ()
    gap: tuple[float, float] | None = None

    def top(self) -> tuple[str, tuple[Stated, ...]]:
        """Return the most probable hypothesis: its kind, and its causes if it is a set."""
        best = max([self.none, self.unexplained, *(p for p, _ in self.sets)])
        if not best:
            return "no answer", ()
        if self.sets and self.sets[0][0] == best:
            return "set", self.sets[0][1]
        return ("none" if self.none == best else "unexplained"), ()


NO_ANSWER = EntryAnswer()


def read_answer(text: str, effects: frozenset[str]) -> EntryAnswer:
    """Read an answer.

    Args:
        text: JSON.
        effects: names that an effect may have.

    Raises:
        AnswerError: it is no JSON, or breaks the format.
    """
    try:
        given = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise AnswerError(f"the answer is not JSON: {error}") from error
    if not isinstance(given, dict) or given.get("format") != 1:
        raise AnswerError('the answer is no object with "format": 1')
    stated = []
    for number, row in enumerate(_list(given.get("sets", []), "sets")):
        if not isinstance(row, dict):
            raise AnswerError(f"sets[{number}] is no object")
        causes = _list(row.get("causes"), f"sets[{number}].causes")
        if not 1 <= len(causes) <= _MOST_CAUSES:
            raise AnswerError(f"sets[{number}] has {len(causes)} causes; 1 to {_MOST_CAUSES}")
        where = f"sets[{number}].causes"
        probability = _number(row.get("probability"), f"sets[{number}].probability", 0.0)
        stated.append((probability, tuple(_cause(cause, where, effects) for cause in causes)))
    gap = given.get("gap")
    answer = EntryAnswer(
        _number(given.get("none", 0.0), "none", 0.0),
        _number(given.get("unexplained", 0.0), "unexplained", 0.0),
        tuple(sorted(stated, key=lambda entry: -entry[0])),
        None if gap is None else _pair(gap, "gap", 0.0),
    )
    total = answer.none + answer.unexplained + sum(p for p, _ in answer.sets)
    if total > 1 + _SUM_ERROR:
        raise AnswerError(f"the probabilities sum to {total:.6g}, more than 1")
    return answer


def _cause(row: object, where: str, effects: frozenset[str]) -> Stated:
    if not isinstance(row, dict) or row.get("effect") not in effects:
        raise AnswerError(f"{where}: give one of the effects {', '.join(sorted(effects))}")
    places = _list(row.get("places"), f"{where}.places")
    if not places or not all(isinstance(place, str) for place in places):
        raise AnswerError(f"{where}.places: give at least one name, as body:stage2")
    size, interval = row.get("size"), row.get("interval")
    return Stated(
        str(row["effect"]),
        tuple(dict.fromkeys(map(str, places))),
        None if size is None else _number(size, f"{where}.size"),
        None if interval is None else _pair(interval, f"{where}.interval"),
    )


def _list(value: object, what: str) -> list[object]:
    if not isinstance(value, list):
        raise AnswerError(f"{what} is no list")
    return value


def _number(value: object, what: str, low: float = -math.inf) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise AnswerError(f"{what} is no finite number")
    if value < low:
        raise AnswerError(f"{what} is {value}, less than {low:g}")
    return float(value)


def _pair(value: object, what: str, low: float = -math.inf) -> tuple[float, float]:
    pair = [_number(part, what, low) for part in _list(value, what)]
    if len(pair) != 2:
        raise AnswerError(f"{what}: give two numbers")
    return pair[0], pair[1]
