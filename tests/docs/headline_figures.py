"""The table of README: the figures of all benches that matter most."""

from collections.abc import Sequence

from tests.bench.kept import of
from tests.bench.real import rate_cases
from tests.bench.scorecard_rates import rate_rows
from tests.docs.formats import code_span, table
from tests.docs.model_figures import frf_gradient_ms, frf_ratio
from tests.docs.modes_figures import identify_extra, identify_found
from tests.docs.results import bench_rows
from tests.docs.scorecard_figures import FORMER, rate_text

# Question; cell of the scorecard; its rate.
SCORECARD = (
    (
        "One fault beside 5 or 15 % of small errors, ratio 4: first",
        "beside 5 or 15 % of dirt, ratio 4",
        "right",
    ),
    (
        "One fault beside 5 or 15 % of small errors, ratio 2: first",
        "beside 5 or 15 % of dirt, ratio 2",
        "right",
    ),
    ("Nothing missing, and the verdict says so", "nothing missing, all", "right"),
    ("A wrong cause is named, all campaigns", "all", "wrong cause"),
)


def headlines_table() -> str:
    """Headline figures of all benches, with n and the bench that makes each."""
    rows: list[Sequence[object]] = [*_real_rows(), *_scorecard_rows()]
    slycot = frf_ratio("the same by 73 evaluations of python-control with slycot")
    rows += [
        _drives_row(),
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


def _real_rows() -> list[Sequence[object]]:
    """Return how often computed changes of the measured tower are named, by both states and one."""
    labels = {
        "2": "A change of a measured tower between two visits, or none: named right",
        "1": "Such a change without the test before it: named right",
    }
    rows = [
        (label, rate_cases("all", list(of(f"real.{n}").values()))) for n, label in labels.items()
    ]
    return [
        (
            label,
            rate_text({**row, "right": 100 * row["right"] / row["n"]}, "right"),
            row["n"],
            "real",
        )
        for label, row in rows
    ]


def _scorecard_rows() -> list[Sequence[object]]:
    """Return the rows of the scorecard whose series is whole."""
    cells = {row["cell"]: row for row in rate_rows(list(of(FORMER).values()))}
    return [
        (label, rate_text(cells[cell], rate), cells[cell][f"{rate} n"], "scorecard")
        for label, cell, rate in SCORECARD
    ]


def _drives_row() -> Sequence[object]:
    """Return how often motors and encoders alone show a fault first."""
    drives = next(row for row in bench_rows("without_hammer") if row["test"] == "drives")
    return (
        "One fault, ratio 4, by motors and encoders alone: first",
        f"{drives['found %']:.1f} % [{drives['from']:.1f}, {drives['to']:.1f}]",
        drives["n"],
        "without_hammer",
    )


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
