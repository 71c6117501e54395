"""Figures of the benches of the withheld truth, of property tests and of mutated files."""

from tests.docs.formats import code_span, fixed, significant, table
from tests.docs.results import bench_rows

LEAKS = {
    "whether something is missing": "Whether something is missing",
    "kind of place": "Kind of place",
    "planted: one hit more in 2 of 5 where nothing is missing": (
        "Planted leak: one hit more in two fifths of the campaigns that lack nothing"
    ),
    "planted: one hit more in 5 of 5 where nothing is missing": (
        "Planted leak: one hit more in all campaigns that lack nothing"
    ),
}


def survival_table() -> str:
    """Survival ratio after a full refit, by effect and wanted ratio."""
    rows = [row for row in bench_rows("survival") if row["wanted"] != ""]
    ratios = sorted({row["wanted"] for row in rows})
    found = {(row["effect"], row["wanted"]): row["full refit"] for row in rows}
    effects = dict.fromkeys(row["effect"] for row in rows)
    return table(
        ("Effect", *(f"Wanted {ratio:g}" for ratio in ratios)),
        [
            (code_span(name), *(significant(found[name, ratio], 2) for ratio in ratios))
            for name in effects
        ],
    )


def truth_table() -> str:
    """Time and discarded draws of a withheld case, by effect."""
    rows = [
        (
            code_span(row["effect"]) if row["effect"] != "all" else "All",
            row["n"],
            fixed(row["s a case"], 2),
            row["discarded"],
            fixed(row["discarded %"], 1),
        )
        for row in bench_rows("truth")
    ]
    return table(("Effect", "Cases", "Time per case [s]", "Discarded draws", "Discarded [%]"), rows)


def properties_passed() -> str:
    """Property tests that pass with many examples each."""
    (row,) = bench_rows("properties")
    total = row["passed"] + row["failed"] + row["error"]
    return f"{row['passed']} of {total} with {row['examples']} examples each"


def leaks_table() -> str:
    """Balanced accuracy of boosted trees that see everything but the FRFs."""
    rows = [
        (
            LEAKS[row["told"]],
            fixed(row["balanced accuracy %"], 1),
            f"{row['from']:.1f} to {row['to']:.1f}",
            fixed(row["chance %"], 1),
            row["n"],
        )
        for row in bench_rows("leaks")
    ]
    header = ("Question", "Balanced accuracy [%]", "95 % interval", "Chance [%]", "Campaigns")
    return table(header, rows)


def _state_rate(rate: dict) -> str:
    """Return hits, number of cases and 95 % interval."""
    low, high = 100 * rate["from"], 100 * rate["to"]
    return f"{rate['found']} of {rate['n']} ({low:.0f} to {high:.0f} %)"


def smallest_sizes_table() -> str:
    """Rates at which multiples of predicted smallest sizes are found."""
    rows = [
        (
            code_span(row["effect"]),
            code_span(row["location"]),
            f"{code_span(row['parameter'])} {significant(row['value'])}",
            *(_state_rate(row[size]) for size in ("0.5", "1", "2")),
        )
        for row in bench_rows("smallest_sizes")
    ]
    header = ("Effect", "Place", "Predicted size", "Half", "Once", "Twice")
    return table(header, rows, 3)


def fuzz_table() -> str:
    """Mutations of every reader, and how many ended in anything but a sentence."""
    rows = [
        (row["target"].capitalize(), row["mutations"], row["faults"]) for row in bench_rows("fuzz")
    ]
    return table(("Reader", "Mutations", "Faults"), rows)


FIGURES = {
    "smallest-sizes-table": smallest_sizes_table,
    "survival-table": survival_table,
    "truth-table": truth_table,
    "leaks-table": leaks_table,
    "properties-passed": properties_passed,
    "fuzz-table": fuzz_table,
}
