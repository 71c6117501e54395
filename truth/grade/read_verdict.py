"""Read a verdict file as the contract has it; what breaks the contract is refused by name.

More keys than the contract's are allowed, but for the probabilities: there they would be
hypotheses that nobody knows.
"""

import math
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

from truth.errors import TruthError
from truth.grade.json_reading import items, number, number_or_null, read_json, table, text
from truth.grade.verdict import (
    EXPLAINED,
    NONE,
    PARTLY,
    SEVERAL,
    UNEXPLAINED,
    WORDS,
    Interval,
    Numbers,
    Row,
    StatedVerdict,
    canonical,
    check_place,
    direction,
)

ABOVE = 0.01  # by which probabilities may sum to more than 1: they are rounded
OMITTED = 0.2  # that may be missing: rows below 0.01 need not be stated
_PROBABILITY_ROUNDING = 1e-9
_KEYS = ("verdict", "probability", "gap", "where", "causes", "twins", "not_testable")
_LAST = "next_experiment"


def read_verdict(path: Path) -> StatedVerdict:
    """Read and check a verdict.

    Raises:
        TruthError: the file is missing, or breaks the contract; one sentence says where.
    """
    return verdict_from(read_json(path))


def verdict_from(value: object) -> StatedVerdict:
    """Check a verdict that is read already.

    Raises:
        TruthError: it breaks the contract; one sentence says where.
    """
    given = table(value, "verdict file", *_KEYS, _LAST)
    word = text(given["verdict"], "verdict")
    if word not in WORDS:
        raise TruthError(f"verdict {word[:40]!r}: expected one of {', '.join(WORDS)}")
    stated = table(given["probability"], "probability", NONE, UNEXPLAINED, SEVERAL)
    if unknown := sorted(stated.keys() - {NONE, UNEXPLAINED, SEVERAL}):
        raise TruthError(f"probability: {unknown[0][:40]!r} is no hypothesis of the contract")
    retuned, after = _gap(given["gap"])
    verdict = StatedVerdict(
        verdict=word,
        none=_probability(stated[NONE], NONE),
        unexplained=_probability(stated[UNEXPLAINED], UNEXPLAINED),
        several=_probability(stated[SEVERAL], SEVERAL),
        causes=tuple(_row(row, f"causes[{i}]") for i, row in enumerate(_list(given, "causes"))),
        where=None if given["where"] is None else _where(given),
        twins=tuple(_twins(group, f"twins[{i}]") for i, group in enumerate(_list(given, "twins"))),
        retuned=retuned,
        after=after,
    )
    for item in _list(given, "not_testable"):
        text(item, "not_testable")
    if given[_LAST] is not None:
        text(given[_LAST], _LAST)
    _check(verdict)
    return verdict


def _check(verdict: StatedVerdict) -> None:
    """Refuse what contradicts itself."""
    rows = [row.probability for row in verdict.causes]
    least = {EXPLAINED: 1, PARTLY: 1, SEVERAL: 2}.get(verdict.verdict, 0)
    if len(rows) < least:
        raise TruthError(f"causes: {verdict.verdict!r} needs {least} at least, got {len(rows)}")
    places = [
        (row.effect, place) for row in verdict.causes for place in row.places or (row.location,)
    ]
    if len(set(places)) < len(places):
        raise TruthError("causes: an effect is given twice at one location")
    if any(low < high for low, high in pairwise(rows)):
        raise TruthError("causes: expected the most probable first")
    present = 1 - verdict.none - verdict.unexplained + ABOVE
    if rows and rows[0] > present:
        raise TruthError(f"probability: a cause has {rows[0]:g}, none and unexplained leave less")
    # Each cause counts in all sets of several that have it: their sum may be more than 1.
    total = verdict.none + verdict.unexplained + verdict.several + sum(rows)
    most = 1 + ABOVE + len(rows) * verdict.several
    if not 1 - OMITTED <= total <= most:
        raise TruthError(
            f"probability: all sum to {total:.3f}, expected 1 (from {1 - OMITTED:g} to {most:.3f},"
            " as rows below 0.01 may be left out and sets of several count in each row)"
        )


def _probability(value: object, what: str) -> float:
    return min(1.0, number(value, f"probability of {what}", 0.0, 1 + _PROBABILITY_ROUNDING))


def _list(given: Mapping[str, object], key: str) -> list[object]:
    return items(given[key], key)


def _gap(value: object) -> tuple[float | None, float | None]:
    """Return the excess re-tuned and after."""
    gap = table(value, "gap", "as_drawn", "retuned", "after", "noise", "closed")
    excesses: list[float | None] = []
    for key in ("as_drawn", "retuned", "after"):
        if gap[key] is None:
            excesses.append(None)
            continue
        inside = table(gap[key], f"gap.{key}", "error", "excess")
        number_or_null(inside["error"], f"gap.{key}.error", 0.0)
        excesses.append(number_or_null(inside["excess"], f"gap.{key}.excess", 0.0))
    number_or_null(gap["noise"], "gap.noise", 0.0)
    number_or_null(gap["closed"], "gap.closed")
    return excesses[1], excesses[2]


def _row(value: object, what: str) -> Row:
    given = table(value, what, "effect", "location", "probability", "parameters")
    effect = text(given["effect"], f"{what}.effect")
    location = check_place(effect, text(given["location"], f"{what}.location"))
    places = tuple(
        check_place(effect, text(place, f"{what}.places"))
        for place in items(given.get("places", []), f"{what}.places")
    )
    if places and location not in places:
        raise TruthError(f"{what}.places: {location} is not among them")
    dof = given.get("dof")
    parameters = table(given["parameters"], f"{what}.parameters")
    components = {
        name: _components(stated, f"{what}.parameters.{name}")
        for name, stated in parameters.items()
        if stated is not None
    }
    interval = given.get("interval")
    intervals = {} if interval is None else table(interval, f"{what}.interval")
    after = given.get("excess_after")
    return Row(
        effect=effect,
        location=location,
        probability=_probability(given["probability"], what),
        dof="" if dof is None else direction(text(dof, f"{what}.dof")),
        parameters=components,
        interval={
            name: _interval(stated, len(components[name]), f"{what}.interval.{name}")
            for name, stated in intervals.items()
            if stated is not None and name in components
        },
        excess_after=None if after is None else number(after, f"{what}.excess_after", 0.0),
        places=places,
    )


def _numbers(value: object, what: str) -> Numbers:
    if not isinstance(value, list):
        return (number(value, what),)
    if not value:
        raise TruthError(f"{what}: is empty")
    return tuple(number(component, what) for component in value)


def _components(value: object, what: str) -> Numbers:
    """Return a number or a vector; a component that is null, since nothing shows it, is nan."""
    if not isinstance(value, list) or not value:
        return _numbers(value, what)
    return tuple(math.nan if component is None else number(component, what) for component in value)


def _interval(value: object, size: int, what: str) -> Interval:
    """Return an interval for each component; of a vector a list of them."""
    given = items(value, what)
    if size == 1 and len(given) == 2 and not isinstance(given[0], list):
        given = [given]
    unknown = (math.nan, math.nan)
    pairs = tuple(unknown if pair is None else _numbers(pair, what) for pair in given)
    if len(pairs) != size or any(len(pair) != 2 or pair[0] > pair[1] for pair in pairs):
        raise TruthError(f"{what}: expected [low, high], of a vector one for each component")
    return tuple((low, high) for low, high in pairs)


def _where(given: Mapping[str, object]) -> tuple[tuple[str, float | None], ...]:
    places = []
    for index, item in enumerate(_list(given, "where")):
        row = table(item, f"where[{index}]", "location", "share")
        share = row["share"]
        if share is not None:
            share = min(1.0, number(share, f"where[{index}].share", 0.0, 1 + _PROBABILITY_ROUNDING))
        places.append((canonical(text(row["location"], f"where[{index}].location")), share))
    if len({place for place, _ in places}) < len(places):
        raise TruthError("where: a location is given twice")
    shares = [share for _, share in places if share is not None]
    if len(shares) not in (0, len(places)):
        raise TruthError("where: some shares are null, others not")
    if sum(shares) > 1 + ABOVE or any(low < high for low, high in pairwise(shares)):
        raise TruthError("where: expected shares that sum to 1 at most, the largest first")
    return tuple(places)


def _twins(value: object, what: str) -> frozenset[tuple[str, str]]:
    labels = [text(item, what).partition("@") for item in items(value, what)]
    twins = frozenset((effect, check_place(effect, place)) for effect, _, place in labels)
    if len(twins) < 2 or len(twins) < len(labels):
        raise TruthError(f"{what}: expected two or more different effect@location")
    return twins
