r"""Grade all cases: the verdicts, and every baseline on the same cases by the same marks.

What pure chance would score, exactly.

The guesser draws an effect, all alike, then one of its places, all alike: p = 1 / (number of
effects x number of the effect's places). It knows what may sit where, and never says none. The
three most probable are drawn one after the other, none twice; one of a set A is among them with

    1 - sum_{i,j} p_i p_j / (1 - p_i) (S - p_i - p_j) / (1 - p_i - p_j),

i and j different and outside A, S the sum outside A. Probabilities are stated as they are drawn.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from truth.errors import TruthError
from truth.grade.answer import Truth
from truth.grade.baselines import RANKINGS, gain_verdict, hypotheses_of, mass_verdict, refit_only
from truth.grade.cases import CaseFiles, Read, read_cases
from truth.grade.compare import DrawingComparison, compare
from truth.grade.marks import FLOOR, NO_EXCESS, Excess, Marks, marks_of
from truth.grade.scores import Judged, Scores, ratio_of, scores_of
from truth.grade.verdict import EXPLAINED, First, StatedVerdict, canonical, first_of
from truth.machine.station import Real


@dataclass(frozen=True)
class BaselineScores:
    """A baseline's scores.

    Args:
        skipped: cases that it cannot judge, and why.
        scores: of the others; None if there are none.
    """

    skipped: dict[str, str]
    scores: Scores | None


@dataclass(frozen=True)
class Line:
    """One case in short.

    Args:
        name, machine, tags, ratio: of the case.
        truth: true effect; what is outside the catalogue by its kind.
        places: the true ones.
        verdict: its word; ``failed`` if it could not be read.
        first: the most probable hypothesis; of a cause with place and probability.
        where: the place with most of the gap.
        marks: by name, as in ``RATES`` and ``MEANS``.
    """

    name: str
    machine: str
    tags: tuple[str, ...]
    ratio: str
    truth: str
    places: tuple[str, ...]
    verdict: str
    first: dict[str, str | float]
    where: str | None
    marks: dict[str, float | None]


@dataclass(frozen=True)
class Report:
    """What a grading yields.

    Args:
        cases: how many were given.
        failed: verdicts that are missing or malformed, and why; they are graded, as wrong.
        ungraded: cases without a readable answer, and why.
        remarks: refits that could not be read, by case.
        verdicts: scores of the verdicts; None if no case could be graded.
        baselines: ``random``, ``refit_only``, ``frac_gain``, ``frac_mass``, ``residual_gain``,
            ``residual_mass``, ``comac_gain``, ``comac_mass``.
        lines: all graded cases.
    """

    cases: int
    failed: dict[str, str]
    ungraded: dict[str, str]
    remarks: dict[str, tuple[str, ...]]
    verdicts: Scores | None
    baselines: dict[str, BaselineScores]
    lines: tuple[Line, ...]


def grade(cases: Sequence[CaseFiles], *, baselines: bool = True) -> Report:
    """Grade verdicts against sealed answers.

    Args:
        cases: their files.
        baselines: whether the campaigns are read for the baselines, too.

    Raises:
        TruthError: a case's name is given twice. Nothing else stops a grading.
    """
    read, ungraded = read_cases(cases)
    judged = [
        _judge(entry, marks_of(entry.truth, entry.verdict, entry.excess), entry.verdict)
        for entry in read
    ]
    return Report(
        cases=len(cases),
        failed={entry.case.name: entry.failure for entry in read if entry.failure},
        ungraded=ungraded,
        remarks={entry.case.name: entry.remarks for entry in read if entry.remarks},
        verdicts=scores_of(judged) if judged else None,
        baselines=_baselines(read) if baselines else {},
        lines=tuple(_line(entry) for entry in judged),
    )


def to_json(report: Report) -> str:
    """Return the report as JSON, each dataclass an object with the names of its fields.

    Numbers that do not exist are null; there is no NaN.
    """
    return (
        json.dumps({"format": 1, **asdict(report)}, indent=1, allow_nan=False, ensure_ascii=False)
        + "\n"
    )


def _judge(read: Read, marks: Marks, verdict: StatedVerdict | None) -> Judged:
    return Judged(read.case.name, read.machine, read.tags, read.truth, marks, verdict)


def _baselines(read: Sequence[Read]) -> dict[str, BaselineScores]:
    judgements: dict[str, list[Judged]] = {"random": [], "refit_only": []}
    judgements |= {f"{rank}_{blame}": [] for rank in RANKINGS for blame in ("gain", "mass")}
    skipped: dict[str, dict[str, str]] = {name: {} for name in judgements}
    for entry in read:
        name = entry.case.name
        try:
            judgements["refit_only"].append(_said(entry, refit_only(entry.excess)))
        except TruthError as error:
            skipped["refit_only"][name] = str(error)
        try:
            comparison = compare(entry.case.campaign)
        except (TruthError, np.linalg.LinAlgError) as error:
            for baseline in skipped.keys() - {"refit_only"}:
                skipped[baseline][name] = str(error)
            continue
        for baseline, judged in _of_files(entry, comparison).items():
            judgements[baseline].append(judged)
    return {
        name: BaselineScores(skipped[name], scores_of(judged) if judged else None)
        for name, judged in judgements.items()
    }


def _of_files(read: Read, comparison: DrawingComparison) -> Mapping[str, Judged]:
    """Return the judgements of one campaign's files, by the baseline's name."""
    chance = chance_marks(read.truth, hypotheses_of(comparison), read.excess)
    judgements = {"random": _judge(read, chance, None)}
    for rank, ranking in RANKINGS.items():
        judgements[f"{rank}_gain"] = _said(read, gain_verdict(comparison, ranking))
        judgements[f"{rank}_mass"] = _said(read, mass_verdict(comparison, ranking))
    return judgements


def _said(read: Read, verdict: StatedVerdict) -> Judged:
    return _judge(read, marks_of(read.truth, verdict, read.excess), verdict)


def _line(judged: Judged) -> Line:
    verdict = judged.verdict or StatedVerdict("")
    first: First = first_of(verdict)
    return Line(
        name=judged.name,
        machine=judged.machine,
        tags=judged.tags,
        ratio=ratio_of(judged.truth),
        truth=judged.truth.label,
        places=judged.truth.places,
        verdict=verdict.verdict,
        first={"effect": first.effect, "place": first.place, "probability": first.probability},
        where=verdict.where[0][0] if verdict.where else None,
        marks=dict(judged.marks),
    )


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
