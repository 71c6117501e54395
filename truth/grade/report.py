"""Grade all cases: the verdicts, and every baseline on the same cases by the same marks."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from truth.errors import TruthError
from truth.grade.baselines import RANKINGS, gain_verdict, hypotheses_of, mass_verdict, refit_only
from truth.grade.cases import CaseFiles, Read, read_cases
from truth.grade.chance import chance_marks
from truth.grade.compare import DrawingComparison, compare
from truth.grade.marks import Marks, marks_of
from truth.grade.scores import Judged, Scores, ratio_of, scores_of
from truth.grade.verdict import First, StatedVerdict, first_of


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
