"""Grades of a blind test: tables, page and JSON, from the files of its cases."""

import json
import tomllib
from collections.abc import Sequence

from mbw.blind.case import TREES, BlindCase
from mbw.blind.page import GRADES, PAGE, TABLES, describe_draws, describe_failures, render
from mbw.output_folder import OutputFolder
from truth.grade import CaseFiles, Report, grade, tables, to_json
from truth.grade.rates import rate_of


def write_grades(output: OutputFolder, cases: Sequence[BlindCase], title: str) -> Report:
    """Grade the cases that were drawn, and write the grades with their page.

    Args:
        cases: cases that were drawn.
    """
    report = grade([graded_case(case) for case in cases])
    failures = describe_failures(output.path)
    page = render(
        json.loads(to_json(report)), tables(report), title, failures, describe_draws(output.path)
    )
    with output.write() as place:
        (place / GRADES).write_text(to_json(report) + "\n", encoding="utf-8")
        (place / TABLES).write_text(tables(report), encoding="utf-8")
        (place / PAGE).write_text(page, encoding="utf-8")
    return report


def count_found(
    cases: Sequence[BlindCase], effect: str
) -> tuple[tuple[int, int], tuple[float, float]]:
    """Return how often verdicts name an effect and its place.

    Args:
        cases: cases that were drawn; those without the effect do not count.

    Returns:
        Cases that are right, and the number of cases; 95 % interval of the rate (Wilson).
    """
    report = grade([graded_case(case) for case in cases], baselines=False)
    rate = rate_of([line.marks["both_or_twin"] for line in report.lines if line.truth == effect])
    return (round(rate.hits), rate.n), (rate.low or 0.0, 1.0 if rate.high is None else rate.high)


def describe_discarded_draws(cases: Sequence[BlindCase]) -> str:
    """Return a sentence on draws that no plausible size of the effect made strong enough."""
    answers = [tomllib.loads(case.sealed.read_text("utf-8")) for case in cases]
    effects = sum(
        len(answer.get("cause", [answer])) for answer in answers if answer["effect"] != "none"
    )
    discarded = sum(answer["drawn"]["discarded"] for answer in answers)
    if not effects:
        return "no effects were drawn"
    return (
        f"{effects} effects were drawn; {discarded} of {discarded + effects} draws "
        f"({discarded / (discarded + effects):.0%}) were discarded: no plausible size of the "
        "effect had the wanted strength"
    )


def graded_case(case: BlindCase) -> CaseFiles:
    """Return the paths of a case's files for the grading."""
    oracle = case.oracle if case.oracle.is_file() else None
    machine = "random trees" if case.model == TREES else ""
    return CaseFiles(
        case.name, case.campaign, case.verdict, case.sealed, case.refit, oracle, machine=machine
    )
