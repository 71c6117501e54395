"""Figures of the bench of virtual hammer tests."""

from tests.docs.formats import significant, table
from tests.docs.results import bench_rows


def simulate_table() -> str:
    """Time, error and variance of the station's full test."""
    rows = [
        (
            row["test"],
            str(row["hits"]),
            significant(row["CPU s"], 2),
            f"{row['estimated error']:.1e}",
            "" if row["chi-square"] else f"{row['largest error of a channel']:.1e}",
            "" if row["chi-square"] == "" else f"{row['chi-square']:.2f}",
        )
        for row in bench_rows("simulate")
    ]
    heads = ("Test", "Hits", "CPU time [s]", "Estimated error", "Largest error", "Chi-square")
    return table(heads, rows)


def simulate_cpu_seconds() -> str:
    """CPU time of the station's full test [s]."""
    return significant(bench_rows("simulate")[0]["CPU s"], 2)


def simulate_error() -> str:
    """Largest error of a channel against the linear model, in per cent of its rms."""
    return f"{100 * bench_rows('simulate')[0]['largest error of a channel']:.2g} %"


def simulate_chi_square() -> str:
    """Squared errors over the stated variance."""
    return f"{bench_rows('simulate')[1]['chi-square']:.2f}"


def excitation_table() -> str:
    """How many exact FRFs of shaken machines lie in their stated region."""
    rows = [
        (
            row["force"].capitalize(),
            row["inputs"],
            row["independent blocks"],
            f"{row['inside %']:.1f} [{row['from']:.1f}, {row['to']:.1f}]",
            row["tests"],
        )
        for row in bench_rows("excitation")
    ]
    header = ("Force", "Inputs", "Independent blocks", "Inside [%]", "Tests")
    return table(header, rows)


FIGURES = {
    "excitation-table": excitation_table,
    "simulate-table": simulate_table,
    "simulate-cpu-seconds": simulate_cpu_seconds,
    "simulate-error": simulate_error,
    "simulate-chi-square": simulate_chi_square,
}
