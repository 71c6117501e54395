"""Figures of real machines: verdicts on campaigns of others, computed changes of one of them."""

from collections.abc import Mapping

from tests.docs.formats import code_span, table
from tests.docs.results import bench_rows


def measured_table() -> str:
    """Verdicts on each campaign, before reciprocity and now, beside the answer."""
    rows = [
        (code_span(row["campaign"]), row["before"], row["now"], row["answer"])
        for row in bench_rows("measured")
    ]
    return table(("Campaign", "Before", "Now", "Answer"), rows, text=4)


def real_table() -> str:
    """Computed changes that were named right and wrong, before reciprocity and now."""
    rows = [
        (
            row["change"].replace("_", " ").capitalize(),
            row["engine"],
            *(_rate(row, name) for name in ("right", "wrong")),
        )
        for row in bench_rows("real")
        if row["n"]
    ]
    return table(("Change", "Engine", "Right", "Wrong"), rows, text=2)


def _rate(row: Mapping, name: str) -> str:
    """Return a count of all cases, with the 95 % interval of the rate."""
    low, high = (round(row[f"{name} {end}"]) for end in ("from", "to"))
    return f"{row[name]} of {row['n']} ({low} to {high} %)"


FIGURES = {"measured-table": measured_table, "real-table": real_table}
