"""Figures of the benches on mutated files, and on fits at the error that the model has."""

from tests.docs.formats import significant, table
from tests.docs.results import bench_rows


def fuzz_table() -> str:
    """Mutations of every reader, and how many ended in anything but a sentence."""
    rows = [
        (row["target"].capitalize(), row["mutations"], row["faults"]) for row in bench_rows("fuzz")
    ]
    return table(("Reader", "Mutations", "Faults"), rows)


def error_floor_table() -> str:
    """Rank of the true effect about fits at their own error floor."""
    rows = [
        (row["figure"], significant(row["value"], 3), row["n"]) for row in bench_rows("error_floor")
    ]
    return table(("Figure", "Value", "n [95 % interval]"), rows)


FIGURES = {"fuzz-table": fuzz_table, "error_floor-table": error_floor_table}
