"""Figures of the bench on mutated files."""

from tests.docs.formats import table
from tests.docs.results import bench_rows


def fuzz_table() -> str:
    """Mutations of every reader, and how many ended in anything but a sentence."""
    rows = [
        (row["target"].capitalize(), row["mutations"], row["faults"]) for row in bench_rows("fuzz")
    ]
    return table(("Reader", "Mutations", "Faults"), rows)


FIGURES = {"fuzz-table": fuzz_table}
