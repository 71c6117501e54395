"""The table of README: the figures of all benches that matter most."""

from collections.abc import Sequence

from tests.docs.calibration_figures import stated_rates
from tests.docs.formats import code_span, table
from tests.docs.grades import HELD
from tests.docs.model_figures import frf_gradient_ms, frf_ratio
from tests.docs.modes_figures import identify_extra, identify_found
from tests.docs.results import bench_rows, bench_values, grade_rate

# Question; bench, title, row and column of its grade table.
RATES = (
    (
        "False alarms where nothing is missing, or only the tuning is off",
        "silence",
        "verdicts",
        "false_alarm",
        "rate [95 %]",
    ),
    (
        "Fault of a sensor, the hammer or a set-up: effect and place first",
        "diagnosis",
        "by tag",
        "measurement",
        "both",
    ),
    (
        "One effect of the machine, survival ratio nearest 4: effect and place first",
        "catalogue",
        "by tag",
        "linear at 4",
        "both",
    ),
    ("Two effects at once: both found", "catalogue", "by tag", "two", "both"),
    (
        "Effect outside the catalogue: verdict is unexplained",
        "catalogue",
        "by tag",
        "outside",
        "unknown_rejected",
    ),
)
SECONDS = ("median", "95 %")


def headlines_table() -> str:
    """Headline figures of all benches, with n and the bench that makes each."""
    rows: list[Sequence[object]] = [_rate_row(label, *place) for label, *place in RATES]
    slycot = frf_ratio("the same by 73 evaluations of python-control with slycot")
    seconds = [bench_values("catalogue")[f"core seconds, {name}"]["value"] for name in SECONDS]
    sure = stated_rates()[-1]
    rows += [
        ("Causes stated with 0.95 or more, three benches: true", *sure[2:], "doubt"),
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
        (
            "Core seconds per diagnosis, median (95 % quantile)",
            f"{seconds[0]:.0f} ({seconds[1]:.0f})",
            bench_values("catalogue")["cases"]["n"],
            "catalogue",
        ),
    ]
    header = ("Question", "Result [95 % interval]", "n", "`make bench ONLY=`")
    return table(header, [(*row[:3], _benches(str(row[3]))) for row in rows], text=2)


def _benches(names: str) -> str:
    """Return names of benches, separated by commas, as code spans."""
    return ", ".join(map(code_span, names.split(", ")))


def _rate_row(label: str, bench: str, *place: str) -> Sequence[object]:
    rate = grade_rate(bench, *place)
    return label, rate, rate.n, bench


def _intervals_row() -> Sequence[object]:
    """Return how often 95 % intervals hold the truth, of tuned stiffness and of a cause."""
    stiffness, cause = bench_rows("coverage")[0], grade_rate("catalogue", "intervals", "all", HELD)
    low, high = stiffness["from"], stiffness["to"]
    return (
        "95 % intervals that hold the truth: tuned stiffness; parameters of a cause",
        f"{stiffness['coverage %']:.1f} % [{low:.1f}, {high:.1f}]; {cause}",
        f"{stiffness['n']}; {cause.n}",
        "coverage, catalogue",
    )


FIGURES = {"headlines": headlines_table}
