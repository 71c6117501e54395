"""Tables and sentence fragments that the benches of the diagnosis have in common."""

import tomllib
from collections.abc import Callable, Mapping, Sequence

from tests.docs.formats import code_span, percent, significant, table
from tests.docs.results import (
    Rate,
    bench_cases,
    bench_values,
    grade_rate,
    grade_tables,
    seeds_of,
)

RateRow = tuple[str, str, str, str, str]  # label; bench, title, row and column of its grade table
HELD = "hold the truth"  # column of the table of intervals
EFFECTS = {"none": "Nothing missing", "mistuned": "Mis-tuned only", "several": "Two effects"}
TIME_GROUPS = {
    "": "All",
    "nothing": "Nothing missing",
    "mistuned": "Mis-tuned only",
    "measurement": "Fault of the measurement",
    "linear": "One effect of the machine",
    "linear in trees": "One effect, random tree",
    "nonlinear": "Nonlinear effect",
    "two": "Two effects",
    "outside": "Effect outside the catalogue",
}


def rate_table(rows: Sequence[RateRow]) -> str:
    """Return rates with their intervals, one a row."""
    rates = [(label, grade_rate(*place)) for label, *place in rows]
    return table(("", "Rate [95 % interval]", "n"), [(label, r, r.n) for label, r in rates])


def rate_fragment(bench: str, title: str, label: str, column: str) -> Callable[[], str]:
    """Return what makes one rate, with its interval and n, for a sentence."""

    def fragment() -> str:
        rate: Rate = grade_rate(bench, title, label, column)
        return f"{rate} (n = {rate.n})"

    return fragment


def effects_table(bench: str) -> str:
    """Return the rates of a bench for each effect, and errors of its sizes."""
    tables = grade_tables(bench)
    rows = []
    for name in tables["by effect"]:
        both = grade_rate(bench, "by effect", name, "both")
        sizes = tables["sizes"].get(name, {})
        held = tables["intervals"].get(name)
        held_rate = "" if held is None else str(grade_rate(bench, "intervals", name, HELD))
        errors = [_percent_of(sizes.get(column, "-")) for column in ("median error", "90 %")]
        rows.append((EFFECTS.get(name, code_span(name)), both, both.n, *errors, held_rate))
    header = (
        "Effect",
        "Effect and place first",
        "n",
        "Error of size, median",
        "Error of size, 90 % of cases",
        "95 % intervals that hold the truth",
    )
    return table(header, rows)


def time_table(bench: str) -> str:
    """Return the core seconds of a bench, by group of cases."""
    values = bench_values(bench)
    names = {
        f"core seconds, median{', ' if group else ''}{group}": label
        for group, label in TIME_GROUPS.items()
    }
    rows = [
        (label, significant(values[name]["value"], 2), values[name]["n"])
        for name, label in names.items()
        if name in values
    ]
    return table(("Cases", "Core seconds, median", "n"), rows)


def calibration_table(bench: str, title: str) -> str:
    """Return stated probabilities and how often they are true."""
    rows = []
    for stated, row in grade_tables(bench)[title].items():
        if row["mean"] != "-":
            rate = grade_rate(bench, title, stated, "true")
            rows.append((stated, row["mean"], rate, rate.n))
    return table(("Stated probability", "Mean", "True [95 % interval]", "n"), rows)


def wrong_table(cases: str) -> str:
    """Return the cases whose verdict is wrong: what is true and what the verdict states first."""
    rows = []
    for row in bench_cases(cases):
        answer, verdict = tomllib.loads(row["answer"]), row["verdict"]
        if not is_right(answer, verdict):
            causes = [f"`{c['effect']}` at `{c['location']}`" for c in verdict["causes"][:1]]
            said = ", ".join([verdict["verdict"], *causes])
            rows.append((row["seed"], _truth_text(answer), said))
    return table(("Seed", "Truth", "Verdict and its first cause"), rows, text=3)


def is_right(answer: Mapping, verdict: Mapping) -> bool:
    """Return whether a verdict names what an answer holds: effect and place, or none."""
    causes = [(cause["effect"], cause["location"]) for cause in verdict["causes"]]
    truth = [(cause["effect"], cause["location"]) for cause in answer.get("cause", [])]
    if truth:
        return verdict["verdict"] in ("several", "partly") and set(causes[: len(truth)]) == set(
            truth
        )
    if answer["effect"] in ("none", "unexplained"):
        return bool(verdict["verdict"] == answer["effect"])
    first = causes[:1] == [(answer["effect"], answer["location"])]
    return first and verdict["verdict"] in ("explained", "partly")


def seeds_fragment(cases: str) -> Callable[[], str]:
    """Return what makes the range of seeds of kept cases."""
    return lambda: "{} to {}".format(*seeds_of(cases))


def value_fragment(bench: str, figure: str, digits: int = 2) -> Callable[[], str]:
    """Return what makes a figure that the bench names."""
    return lambda: significant(bench_values(bench)[figure]["value"], digits)


def count_fragment(bench: str, figure: str) -> Callable[[], str]:
    """Return what makes a count among a number of cases."""
    return lambda: "{value} of {n}".format(**bench_values(bench)[figure])


def _truth_text(answer: Mapping) -> str:
    if answer["effect"] == "none":
        return "nothing missing"
    causes = answer.get("cause", [answer])
    return ", ".join(
        f"`{cause['effect']}` at `{cause['location']}`, ratio {significant(cause['ratio'], 2)}"
        for cause in causes
    )


def _percent_of(cell: str) -> str:
    return "" if cell == "-" else percent(float(cell))
