"""Figures on real machines: verdicts on measured ones, rates on computed changes of the tower."""

import json

from tests.bench import real
from tests.bench.kept import of
from tests.docs.formats import fixed, table
from tests.docs.results import RESULTS, Rate, bench_rows
from truth.grade.rates import wilson

LEAST_PROBABILITY = 0.1  # of a cause that the table of measured machines shows


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
        unexplained = f"{verdict['probability']['unexplained']:.2f}"
        rows.append(
            (
                path.stem,
                verdict["verdict"],
                unexplained,
                ", ".join(places),
                ", ".join(causes) or "none",
            )
        )
    header = ("Campaign", "Verdict", "Probability unexplained", "First places", "Causes")
    return table(header, rows, text=5)


def levels_table() -> str:
    """Modes that depend on the level, of machines without a model."""
    rows = []
    for path in sorted((RESULTS / "measured").glob("*.levels.json")):
        check = json.loads(path.read_text(encoding="utf-8"))
        changing = [row for row in check["modes"] if row["frequency_changes"]]
        first, last = check["level"][0], check["level"][-1]
        mode = _steadiest(changing)
        frequency = f"{mode['frequency'][0]:.2f} to {mode['frequency'][-1]:.2f}"
        damping = f"{100 * mode['damping'][0]:.3f} to {100 * mode['damping'][-1]:.3f}"
        levels = f"{first:g} to {last:g} {check['unit']}"
        of_all = f"{len(changing)} of {len(check['modes'])}"
        rows.append((path.name.partition(".")[0], levels, of_all, frequency, damping))
    header = ("Machine", "Levels", "Modes that change", "Frequency / Hz", "Damping / %")
    return table(header, rows, text=5)


def _steadiest(modes: list[dict]) -> dict:
    """Return the mode that is identified best at every level."""
    return min(modes, key=lambda mode: max(mode["damping_sd"]) / min(mode["damping"]))


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


def compare_table() -> str:
    """Rates of two visits to dirty virtual machines."""
    rows = []
    for row in bench_rows("compare"):
        rates = [
            Rate(row[name], (row[f"{name} from"], row[f"{name} to"]), row["n"])
            for name in ("named first", "wrong cause")
            if row[name] is not None
        ]
        cells = [*(["-"] * (2 - len(rates))), *map(str, rates)]
        rows.append((row["cases"], row["n"], *cells, row["errors"], f"{row['core s']:.0f}"))
    header = ("Between the visits", "n", "Named first", "A wrong cause", "Errors", "Core seconds")
    return table(header, rows, text=1)


def without_hammer_table() -> str:
    """Rates of diagnoses by motors and encoders, and by a hammer, of the same machines."""
    rows = []
    for row in bench_rows("without_hammer"):
        first = Rate(row["found %"], (row["from"], row["to"]), row["n"])
        share, count = row["wrong cause %"], row["n"]
        low, high = wilson(round(count * share / 100), count)
        wrong = Rate(share, (100 * low, 100 * high), count)
        seconds = f"{row['core s']:.0f}"
        rows.append((row["test"].capitalize(), count, str(first), str(wrong), seconds))
    header = ("Test", "n", "Fault first", "A wrong cause", "Core seconds")
    return table(header, rows, text=1)


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
    "compare-table": compare_table,
    "without-hammer-table": without_hammer_table,
    "measured-levels-table": levels_table,
    "measured-table": measured_table,
    "measured-tower-table": tower_table,
    "sealed-table": sealed_table,
}
