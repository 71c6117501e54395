"""Figures of the scorecard: rates of the diagnosis by cell and effect, stated probabilities."""

from collections import Counter
from collections.abc import Sequence
from functools import cache

from tests.bench.kept import of
from tests.bench.scorecard_draws import reported_designs
from tests.bench.scorecard_rates import (
    Graded,
    left_out,
    rate_rows,
    read_rows,
    sizes,
    stated_probabilities,
    wrong_rows,
)
from tests.docs.formats import code_span, fixed, percent, significant, table
from truth.grade.rates import Rate, rate_of

NAME = "scorecard.810000"
FORMER = "scorecard.650000"  # rows of the engine of version 0.2.0


@cache
def scorecard_cases(name: str = NAME) -> Sequence[Graded]:
    """Return all campaigns of a series that count."""
    return read_rows(of(name).values())


def rate_text(row: dict, name: str) -> str:
    """Return a rate of a row with its interval; empty where nothing was counted."""
    if row[name] is None:
        return ""
    return f"{row[name]:.1f} % [{row[f'{name} from']:.1f}, {row[f'{name} to']:.1f}]"


def scorecard_table(name: str = NAME) -> str:
    """Rates of each cell."""
    rows = [
        (
            str(row["cell"]).capitalize(),
            row["right n"],
            rate_text(row, "right"),
            rate_text(row, "wrong cause"),
            fixed(row["probability"], 2),
            row["errors"],
            fixed(row["core s"], 0),
        )
        for row in rate_rows(list(of(name).values()))
    ]
    header = (
        "Campaigns",
        "n",
        "Right",
        "A wrong cause",
        "Probability of the truth",
        "Errors",
        "Core seconds",
    )
    return table(header, rows)


def effects_table() -> str:
    """Rates of each effect that stands alone, exact or beside dirt, and errors of its sizes."""
    alone = [case for case in scorecard_cases() if len(case.row["effects"]) == 1]
    rows = []
    for effect in sorted({case.row["effects"][0] for case in alone}):
        here = [case for case in alone if case.row["effects"] == [effect]]
        right, errors = rate_of(float(case.is_right) for case in here), sizes(here)
        rows.append(
            (
                code_span(effect),
                right.n,
                _rate(right),
                "" if errors.size.median is None else percent(errors.size.median),
                "" if errors.size.ninety is None else percent(errors.size.ninety),
                _rate(errors.intervals),
                errors.intervals.n,
            )
        )
    header = (
        "Effect",
        "n",
        "Right",
        "Error of size, median",
        "Nine in ten",
        "95 % intervals that hold the truth",
        "n of intervals",
    )
    return table(header, rows)


def stated_table() -> str:
    """How often causes are right that were stated with so much probability."""
    rows = [
        (f"{part.low:g} to {part.high:g}", fixed(part.stated, 3), _rate(part.true), part.true.n)
        for part in stated_probabilities(scorecard_cases()).bins
        if part.stated is not None
    ]
    return table(("Stated probability", "Mean", "Right [95 % interval]", "n"), rows)


def wrong_table() -> str:
    """Verdicts that are wrong."""
    rows = [(seed, *map(_escape, texts)) for seed, *texts in wrong_rows(of(NAME).values())]
    return table(("Seed", "Truth", "Verdict and its first causes"), rows, text=3)


def engines(name: str = NAME) -> str:
    """By which commits of the engine the campaigns were diagnosed."""
    counts = Counter(case.row["engine"] for case in scorecard_cases(name))
    return ", ".join(f"{count} by {engine}" for engine, count in counts.most_common())


def omitted() -> str:
    """Campaigns that do not count, by reason."""
    counts = left_out(of(NAME).values())
    return " and ".join(f"{count} ({reason})" for reason, count in counts.items()) or "none"


def intervals() -> str:
    """How often 95 % intervals of sizes hold the truth, both engines together."""
    rate = sizes((*scorecard_cases(), *scorecard_cases(FORMER))).intervals
    return f"{_rate(rate)} (n = {rate.n})"


def size_error() -> str:
    """Median error of sizes, and that of nine in ten."""
    size = sizes(scorecard_cases()).size
    return f"{percent(size.median or 0.0)} ({percent(size.ninety or 0.0)} in nine of ten)"


def seconds_text() -> str:
    """Median core seconds of a diagnosis."""
    (row,) = [row for row in rate_rows(list(of(NAME).values())) if row["cell"] == "all"]
    return significant(row["core s"], 2)


def _rate(rate: Rate) -> str:
    if rate.rate is None or rate.low is None or rate.high is None:
        return ""
    return f"{percent(rate.rate)} [{100 * rate.low:.1f}, {100 * rate.high:.1f}]"


def _escape(text: str) -> str:
    return text.replace("|", "\\|")


FIGURES = {
    "scorecard-table": scorecard_table,
    "scorecard-former-table": lambda: scorecard_table(FORMER),
    "scorecard-former-campaigns": lambda: str(len(scorecard_cases(FORMER))),
    "scorecard-former-engines": lambda: engines(FORMER),
    "scorecard-effects-table": effects_table,
    "scorecard-stated-table": stated_table,
    "scorecard-wrong-table": wrong_table,
    "scorecard-campaigns": lambda: str(len(scorecard_cases())),
    "scorecard-designs": lambda: str(len(reported_designs())),
    "scorecard-engines": engines,
    "scorecard-omitted": omitted,
    "scorecard-intervals": intervals,
    "scorecard-size-error": size_error,
    "scorecard-seconds": seconds_text,
}
