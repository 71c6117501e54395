"""The table of README: the figures of all benches that matter most."""

from collections.abc import Sequence

from tests.docs.formats import code_span, significant, table
from tests.docs.model_figures import frf_gradient_ms, frf_ratio
from tests.docs.modes_figures import identify_extra, identify_found
from tests.docs.results import RESULTS, bench_rows

# Question; figure of the bench of real machines.
DIRTY = (
    (
        "One fault beside 5 or 15 % of small errors, ratio 4: first",
        "dirt 5 and 15 % together, ratio 4: effect and place first, %",
    ),
    (
        "One fault beside 5 or 15 % of small errors, ratio 2: first",
        "dirt 5 and 15 % together, ratio 2: effect and place first, %",
    ),
    ("One fault of an exact machine: first", "clean: effect and place first, %"),
    ("Nothing missing: false alarms", "nothing: false alarms, %"),
    ("Small errors alone: a wrong cause is named", "alone: wrong cause with p of 0.5 or more, %"),
    ("Two effects at once: both found", "2 effects: all found, %"),
    ("Core seconds per diagnosis, median", "all: core seconds, median"),
)


def headlines_table() -> str:
    """Headline figures of all benches, with n and the bench that makes each."""
    rows: list[Sequence[object]] = [*_dirty_rows()]
    slycot = frf_ratio("the same by 73 evaluations of python-control with slycot")
    rows += [
        _intervals_row(),
        (
            "Modes found without manual selection",
            f"{identify_found()}, {identify_extra()} false",
            len(bench_rows("identify")),
            "identify",
        ),
        (
            "FRFs and gradient of the station, 72 parameters",
            f"{frf_gradient_ms()} ms, {slycot} times faster than differences by python-control",
            "",
            "frf",
        ),
    ]
    header = ("Question", "Result [95 % interval]", "n", "`make bench ONLY=`")
    return table(header, [(*row[:3], _benches(str(row[3]))) for row in rows], text=2)


def _benches(names: str) -> str:
    """Return names of benches, separated by commas, as code spans."""
    return ", ".join(map(code_span, names.split(", ")))


def _dirty_rows() -> list[Sequence[object]]:
    """Return the rows of the bench of real machines that has figures."""
    if not (RESULTS / "dirty.json").is_file():
        return []
    values = {row["figure"]: row for row in bench_rows("dirty")}
    rows: list[Sequence[object]] = []
    for label, figure in DIRTY:
        if figure in values:
            count, _, interval = str(values[figure]["n"]).partition(" ")
            unit = " %" if figure.endswith("%") else ""
            text = f"{significant(values[figure]['value'], 3)}{unit} {interval}".rstrip()
            rows.append((label, text, count, "dirty"))
    return rows


def _intervals_row() -> Sequence[object]:
    """Return how often 95 % intervals of tuned stiffness of exact machines hold the truth."""
    stiffness = bench_rows("coverage")[0]
    return (
        "95 % intervals of tuned stiffness of exact machines that hold the truth",
        f"{stiffness['coverage %']:.1f} % [{stiffness['from']:.1f}, {stiffness['to']:.1f}]",
        stiffness["n"],
        "coverage",
    )


FIGURES = {"headlines": headlines_table}
