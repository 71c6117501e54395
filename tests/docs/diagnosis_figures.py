"""Figures of the benches of the diagnosis: all faults, false alarms, catalogue and protocols."""

import json

from tests.bench import real
from tests.bench.kept import of
from tests.docs.formats import fixed, percent, table
from tests.docs.grades import (
    calibration_table,
    count_fragment,
    effects_table,
    rate_fragment,
    rate_table,
    seeds_fragment,
    time_table,
    value_fragment,
    wrong_table,
)
from tests.docs.results import (
    RESULTS,
    Rate,
    bench_cases,
    bench_rows,
    bench_values,
    grade_rate,
    grade_tables,
)

LEAST_PROBABILITY = 0.1  # of a cause that the table of measured machines shows
DIAGNOSIS_ROWS = (
    ("Nothing missing: false alarms", "silence", "by tag", "nothing", "false_alarm"),
    ("Mis-tuned only: false alarms", "silence", "by tag", "mistuned", "false_alarm"),
    (
        "False alarms in the campaigns of the first bench",
        "diagnosis",
        "verdicts",
        "false_alarm",
        "rate [95 %]",
    ),
    (
        "Faults of sensors, hammer or set-up: effect and place first",
        "diagnosis",
        "by tag",
        "measurement",
        "both",
    ),
    (
        "Linear effects of the machine: effect and place first",
        "diagnosis",
        "by tag",
        "linear",
        "both",
    ),
    ("Nonlinear effects: their place first", "diagnosis", "by tag", "nonlinear", "where_first"),
    ("Any effect: its place first", "diagnosis", "verdicts", "where_first", "rate [95 %]"),
    ("Any effect: its place among three", "diagnosis", "verdicts", "where_top3", "rate [95 %]"),
    ("Effect and place, or nothing, first", "diagnosis", "verdicts", "both", "rate [95 %]"),
)
CATALOGUE_ROWS = (
    ("One effect of the station, ratio nearest 4: effect first", "linear at 4", "effect_first"),
    ("One effect, nearest 4: place first", "linear at 4", "place_first"),
    ("One effect, nearest 4: effect and place first", "linear at 4", "both"),
    ("One effect, nearest 4: truth among confounded causes", "linear at 4", "both_or_twin"),
    ("One effect, nearest 8: effect and place first", "linear at 8", "both"),
    ("One effect, nearest 2: effect and place first", "linear at 2", "both"),
    ("One effect, nearest 1: effect and place first", "linear at 1", "both"),
    ("Random trees, nearest 4: effect and place first", "linear in trees at 4", "both"),
    ("Random trees, nearest 2: effect and place first", "linear in trees at 2", "both"),
    ("Random trees, all ratios: effect and place first", "linear in trees", "both"),
    ("Effects outside the catalogue: verdict is unexplained", "outside", "unknown_rejected"),
    ("Effects outside the catalogue: their place first", "outside", "where_first"),
    ("Two effects: both found", "two", "both"),
)  # fmt: skip
BASELINES = {
    "verdicts": "This project",
    "random": "Random cause",
    "refit_only": "Refit only: never names a cause",
    "residual_mass": "Residual gap by body, called a wrong mass",
    "residual_gain": "Residual gap by sensor, called a wrong gain",
    "frac_mass": "FRAC by body, called a wrong mass",
    "frac_gain": "FRAC by sensor, called a wrong gain",
    "comac_mass": "CoMAC by body, called a wrong mass",
    "comac_gain": "CoMAC by sensor, called a wrong gain",
}
TESTS = {
    "plain": "One hammer point",
    "two points": "Two hammer points",
    "no coherence": "One hammer point, no coherence",
}


def catalogue_table() -> str:
    """Rates of the catalogue bench: one effect, random trees, outside the catalogue, two."""
    return rate_table(
        [(label, "catalogue", "by tag", tag, column) for label, tag, column in CATALOGUE_ROWS]
    )


def baselines_table() -> str:
    """Simple rankings on the campaigns of the catalogue bench that were kept."""
    rows = []
    for name, label in BASELINES.items():
        both = grade_rate("catalogue", "baselines", name, "both")
        where = grade_rate("catalogue", "baselines", name, "where_first")
        rows.append((label, both, where, both.n))
    return table(("Method", "Effect and place first", "Place first", "n"), rows)


def protocols_table() -> str:
    """Rates of three tests of the same machines, and widths of their intervals of sizes."""
    values = bench_values("protocols")
    rows = []
    for test, label in TESTS.items():
        cells: list[object] = [label]
        for ratio in ("1", "0.1"):
            width = values.get(
                f"width of intervals over those of the plain test, {test} at {ratio}"
            )
            both = grade_rate("protocols", "by tag", f"{test} at {ratio}", "both")
            cells += [both, both.n, "1" if width is None else fixed(width["value"], 2)]
        rows.append(cells)
    header = ["Test"]
    for ratio in ("1", "0.1"):
        header += [f"Ratio {ratio}: effect and place first", "n", "Width of intervals"]
    return table(header, rows)


def narrower(ratio: str) -> str:
    """Number of machines whose intervals a second hammer point makes narrower."""
    row = bench_values("protocols")[f"machines where they are narrower, two points at {ratio}, %"]
    count = int(row["n"].split()[0])
    return f"{round(row['value'] * count / 100)} of {count}"


def probability_of_truth(bench: str) -> str:
    """Mean probability of the true hypothesis."""
    return grade_tables(bench)["number"]["probability_of_truth"]["mean"]


def shrink_share(bench: str) -> str:
    """Mean share of the possible shrink of the gap that the verdict's cause reaches."""
    return percent(float(grade_tables(bench)["number"]["shrink_share"]["mean"]))


def size_errors(bench: str) -> str:
    """Median error of sizes and that of nine in ten."""
    row = grade_tables(bench)["sizes"]["all"]
    return f"{percent(float(row['median error']))} ({percent(float(row['90 %']))} in nine of ten)"


def sealed_table() -> str:
    """Verdicts on campaigns whose answers are not known."""
    rows = []
    for path in sorted((RESULTS / "sealed").glob("*.json")):
        verdict = json.loads(path.read_text(encoding="utf-8"))
        causes = verdict["causes"][:1] or [None]
        for cause in causes:
            name = "" if cause is None else f"`{cause['effect']}` at `{cause['location']}`"
            stated = "" if cause is None else f"{cause['probability']:.3f}"
            gaps = [fixed(verdict["gap"][key]["excess"], 2) for key in ("retuned", "after")]
            rows.append((path.stem, verdict["verdict"], name, stated, *gaps))
    header = (
        "Campaign",
        "Verdict",
        "First cause",
        "Probability",
        "Excess, re-tuned",
        "Excess with the cause",
    )
    return table(header, rows, text=3)


def measured_table() -> str:
    """Verdicts on the suspension, with the first places and all likely causes."""
    rows = []
    for path in sorted((RESULTS / "measured").glob("suspension.*.json")):
        verdict = json.loads(path.read_text(encoding="utf-8"))
        places = [f"`{row['location']}` {row['share']:.2f}" for row in verdict["where"][:4]]
        causes = [
            f"`{row['effect']}` at `{row['location']}` {row['probability']:.2f}"
            for row in verdict["causes"]
            if row["probability"] >= LEAST_PROBABILITY
        ]
        told = f"{verdict['probability']['unexplained']:.2f}"
        rows.append(
            (path.stem, verdict["verdict"], told, ", ".join(places), ", ".join(causes) or "none")
        )
    header = ("Campaign", "Verdict", "Probability unexplained", "First places", "Causes")
    return table(header, rows, text=5)


def tower_table() -> str:
    """Verdicts on the measured tower, by one state and before and after, beside the answer."""
    rows = [
        (row["campaign"].removeprefix("tower."), *list(row.values())[1:])
        for row in bench_rows("measured")
        if row["campaign"].startswith("tower.")
    ]
    return table(("Campaign", "One state", "Before and after", "Answer"), rows, text=4)


def real_table() -> str:
    """Rates on computed changes of the tower, by one state and before and after."""
    rows = []
    for states, label in real.STATES.items():
        kept = list(of(f"real.{states}").values())
        for kind in ("all changes", *real.KINDS):
            row = real.rate_cases(kind, kept)
            if not row["n"]:
                continue
            rates = [
                Rate(
                    100 * row[name] / max(row[f"{name} n"], 1),
                    (row[f"{name} from"], row[f"{name} to"]),
                    row[f"{name} n"],
                )
                for name in real.COLUMNS
            ]
            cells = [str(rate) if rate.n else "-" for rate in rates]
            rows.append((label, kind.replace("_", " "), row["n"], *cells, rates[-1].n))
    header = ("States", "Change", "n", "Right", "Wrong", "Sizes within 10 %", "n of sizes")
    return table(header, rows, text=2)


def reciprocity_table() -> str:
    """Ratios and differences by reciprocity on computed changes of the tower."""
    header = (
        "Of",
        "Pairs",
        "Within 2 deviations / %",
        "Changes of one",
        "Named right",
        "Other changes",
        "Named though none",
    )
    rows = [
        tuple(f"{value:.3g}" if isinstance(value, float) else str(value) for value in row.values())
        for row in bench_rows("reciprocity")
    ]
    return table(header, rows, text=1)


FIGURES = {
    "reciprocity-table": reciprocity_table,
    "real-table": real_table,
    "diagnosis-table": lambda: rate_table(DIAGNOSIS_ROWS),
    "diagnosis-campaigns": lambda: str(len(bench_cases("diagnosis.220000"))),
    "diagnosis-seeds": seeds_fragment("diagnosis.220000"),
    "diagnosis-both": rate_fragment("diagnosis", "verdicts", "both", "rate [95 %]"),
    "diagnosis-measurement": rate_fragment("diagnosis", "by tag", "measurement", "both"),
    "diagnosis-linear": rate_fragment("diagnosis", "by tag", "linear", "both"),
    "diagnosis-place": rate_fragment("diagnosis", "verdicts", "where_first", "rate [95 %]"),
    "diagnosis-false-alarms": rate_fragment("diagnosis", "verdicts", "false_alarm", "rate [95 %]"),
    "diagnosis-refit-only": rate_fragment("diagnosis", "baselines", "refit_only", "both"),
    "diagnosis-effects-table": lambda: effects_table("diagnosis"),
    "diagnosis-calibration-table": lambda: calibration_table(
        "diagnosis", "calibration of the causes"
    ),
    "diagnosis-shares-table": lambda: calibration_table("diagnosis", "calibration of the shares"),
    "diagnosis-stated-sure": rate_fragment(
        "diagnosis", "calibration of the causes", "0.95 to 1", "true"
    ),
    "diagnosis-wrong-table": lambda: wrong_table("diagnosis.220000"),
    "diagnosis-time-table": lambda: time_table("diagnosis"),
    "diagnosis-seconds": value_fragment("diagnosis", "core seconds, median"),
    "diagnosis-seconds-95": value_fragment("diagnosis", "core seconds, 95 %"),
    "diagnosis-memory": value_fragment("diagnosis", "GiB at most"),
    "diagnosis-two-threads": count_fragment("diagnosis", "same verdict with two threads"),
    "diagnosis-size-errors": lambda: size_errors("diagnosis"),
    "diagnosis-intervals": rate_fragment("diagnosis", "intervals", "all", "hold the truth"),
    "measured-table": measured_table,
    "measured-tower-table": tower_table,
    "sealed-table": sealed_table,
    "silence-campaigns": lambda: str(len(bench_cases("silence.270000"))),
    "silence-seeds": seeds_fragment("silence.270000"),
    "silence-false-alarms": rate_fragment("silence", "verdicts", "false_alarm", "rate [95 %]"),
    "silence-nothing": rate_fragment("silence", "by tag", "nothing", "false_alarm"),
    "silence-mistuned": rate_fragment("silence", "by tag", "mistuned", "false_alarm"),
    "silence-seconds": value_fragment("silence", "core seconds, median"),
    "silence-time-table": lambda: time_table("silence"),
    "catalogue-table": catalogue_table,
    "catalogue-campaigns": lambda: str(len(bench_cases("catalogue.290000"))),
    "catalogue-seeds": seeds_fragment("catalogue.290000"),
    "catalogue-both": rate_fragment("catalogue", "verdicts", "both", "rate [95 %]"),
    "catalogue-nearest-4": rate_fragment("catalogue", "by tag", "linear at 4", "both"),
    "catalogue-trees": rate_fragment("catalogue", "by tag", "linear in trees", "both"),
    "catalogue-two": rate_fragment("catalogue", "by tag", "two", "both"),
    "catalogue-outside": rate_fragment("catalogue", "by tag", "outside", "unknown_rejected"),
    "catalogue-effects-table": lambda: effects_table("catalogue"),
    "catalogue-calibration-table": lambda: calibration_table(
        "catalogue", "calibration of the causes"
    ),
    "catalogue-stated-sure": rate_fragment(
        "catalogue", "calibration of the causes", "0.95 to 1", "true"
    ),
    "catalogue-wrong-table": lambda: wrong_table("catalogue.290000"),
    "catalogue-baselines-table": baselines_table,
    "catalogue-random": rate_fragment("catalogue", "baselines", "random", "both"),
    "catalogue-time-table": lambda: time_table("catalogue"),
    "catalogue-seconds": value_fragment("catalogue", "core seconds, median"),
    "catalogue-seconds-95": value_fragment("catalogue", "core seconds, 95 %"),
    "catalogue-memory": value_fragment("catalogue", "GiB at most", 3),
    "catalogue-two-threads": count_fragment("catalogue", "same verdict with two threads"),
    "catalogue-truth": lambda: probability_of_truth("catalogue"),
    "catalogue-shrink": lambda: shrink_share("catalogue"),
    "catalogue-size-errors": lambda: size_errors("catalogue"),
    "catalogue-intervals": rate_fragment("catalogue", "intervals", "all", "hold the truth"),
    "protocols-table": protocols_table,
    "protocols-campaigns": lambda: str(len(bench_cases("protocols.155000"))),
    "protocols-seeds": seeds_fragment("protocols.155000"),
    "protocols-narrower-1": lambda: narrower("1"),
    "protocols-narrower-tenth": lambda: narrower("0.1"),
    "protocols-wrong-table": lambda: wrong_table("protocols.155000"),
}
