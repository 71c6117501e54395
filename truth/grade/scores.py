"""From the marks of all cases to scores: together, and split by what the cases are."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from truth.grade.answer import Truth, kinds_of
from truth.grade.marks import MEANS, RATES, Marks, is_present, is_true
from truth.grade.rates import Diagram, Rate, Spread, diagram_of, rate_of, spread_of
from truth.grade.sizes import Sizes, estimates_of, sizes_of
from truth.grade.verdict import FAILED, StatedVerdict, first_of, kind_of

RATIOS = (0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
NOWHERE = "nowhere"
Matrix = dict[str, dict[str, int]]  # truth, said, how often


@dataclass(frozen=True)
class Judged:
    """A case with its marks.

    Args:
        name, machine, tags: of the case.
        truth: what its machine has.
        marks: as ``marks_of``.
        verdict: what is said; None of a baseline that states no verdict.
    """

    name: str
    machine: str
    tags: tuple[str, ...]
    truth: Truth
    marks: Marks
    verdict: StatedVerdict | None


@dataclass(frozen=True)
class Group:
    """The scores of some cases.

    Args:
        n: cases.
        rates: by the names in ``RATES``.
        means: by the names in ``MEANS``.
    """

    n: int
    rates: dict[str, Rate]
    means: dict[str, Spread]


@dataclass(frozen=True)
class CalibrationDiagrams:
    """Whether probabilities are what they say; verdicts that could not be read state none.

    Args:
        first: of the most probable hypothesis, true if effect and place are.
        causes: of every cause that it is present.
        shares: of every place in ``where``, taken as the probability that it is a true one.
    """

    first: Diagram
    causes: Diagram
    shares: Diagram


@dataclass(frozen=True)
class Confusion:
    """What was said how often of each truth.

    Args:
        effects: true effect, effect of the most probable hypothesis.
        kinds: kinds of their places.
        places: their places, by machine.
    """

    effects: Matrix
    kinds: Matrix
    places: dict[str, Matrix]


@dataclass(frozen=True)
class Scores:
    """All scores; the last three are None of a baseline that states no verdict.

    Args:
        all: of all cases.
        by_effect, by_place, by_ratio, by_machine, by_tag: of the cases by true effect, kind of the
            true place, survival ratio (the nearest), machine, and tags.
        calibration, sizes, confusion: see there.
    """

    all: Group
    by_effect: dict[str, Group]
    by_place: dict[str, Group]
    by_ratio: dict[str, Group]
    by_machine: dict[str, Group]
    by_tag: dict[str, Group]
    calibration: CalibrationDiagrams | None
    sizes: Sizes | None
    confusion: Confusion | None


def scores_of(judged: Sequence[Judged]) -> Scores:
    """Return the scores of cases; all of them have a verdict, or none has."""
    stated = [(case, case.verdict) for case in judged if case.verdict is not None]
    return Scores(
        all=_group(judged),
        by_effect=_group_by(judged, lambda case: (case.truth.label,)),
        by_place=_group_by(judged, lambda case: kinds_of(case.truth)),
        by_ratio=_group_by(judged, lambda case: (ratio_of(case.truth),)),
        by_machine=_group_by(judged, lambda case: (case.machine,)),
        by_tag=_group_by(judged, lambda case: case.tags),
        calibration=_calibration(stated) if stated else None,
        sizes=sizes_of(e for case, said in stated for e in estimates_of(case.truth, said))
        if stated
        else None,
        confusion=_confusion(stated) if stated else None,
    )


def ratio_of(truth: Truth) -> str:
    """Return the nearest of ``RATIOS`` of the first cause; else none."""
    return nearest_ratio(truth.causes[0].ratio if truth.causes else None)


def nearest_ratio(ratio: float | None) -> str:
    """Return the nearest of ``RATIOS``, on a logarithmic scale; none of none."""
    if ratio is None:
        return "none"
    log = math.log(max(ratio, 1e-9))
    return f"{min(RATIOS, key=lambda candidate: abs(math.log(candidate) - log)):g}"


def _group(judged: Sequence[Judged]) -> Group:
    return Group(
        n=len(judged),
        rates={name: rate_of(case.marks.get(name) for case in judged) for name in RATES},
        means={name: spread_of(case.marks.get(name) for case in judged) for name in MEANS},
    )


def _group_by(
    judged: Sequence[Judged], labels: Callable[[Judged], Iterable[str]]
) -> dict[str, Group]:
    parts: dict[str, list[Judged]] = {}
    for case in judged:
        for label in labels(case):
            parts.setdefault(label, []).append(case)
    return {label: _group(parts[label]) for label in sorted(parts)}


def _calibration(stated: Sequence[tuple[Judged, StatedVerdict]]) -> CalibrationDiagrams:
    read = [(case.truth, said) for case, said in stated if said.verdict != FAILED]
    firsts = [(truth, first_of(said)) for truth, said in read]
    return CalibrationDiagrams(
        first=diagram_of((first.probability, is_true(truth, first)) for truth, first in firsts),
        causes=diagram_of(
            (row.probability, is_present(truth, row)) for truth, said in read for row in said.causes
        ),
        shares=diagram_of(
            (share, place in truth.places)
            for truth, said in read
            for place, share in said.where or ()
            if share is not None
        ),
    )


def _confusion(stated: Sequence[tuple[Judged, StatedVerdict]]) -> Confusion:
    confusion = Confusion({}, {}, {})
    for case, said in stated:
        first = first_of(said)
        label = FAILED if said.verdict == FAILED else first.effect
        _count(confusion.effects, case.truth.label, label)
        place = FAILED if said.verdict == FAILED else first.place or NOWHERE
        kind = kind_of(first.place) or place
        places = confusion.places.setdefault(case.machine, {})
        for true in case.truth.places or (NOWHERE,):
            _count(places, true, place)
            _count(confusion.kinds, kind_of(true), kind)
    return confusion


def _count(matrix: Matrix, true: str, said: str) -> None:
    row = matrix.setdefault(true, {})
    row[said] = row.get(said, 0) + 1
