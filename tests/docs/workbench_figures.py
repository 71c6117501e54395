"""Figures of the benches of the workbench's latency and of its start."""

from tests.docs.formats import significant, table
from tests.docs.results import bench_rows


def workbench_table() -> str:
    """Latency of each case."""
    rows = [
        (
            row["case"],
            str(row["strokes"]),
            *(significant(row[name], 2) for name in ("median_ms", "p95_ms", "largest_ms")),
        )
        for row in bench_rows("workbench")
        if "case" in row
    ]
    return table(("Case", "Inputs", "Median [ms]", "95 % [ms]", "Largest [ms]"), rows)


def workbench_parameters() -> str:
    """Number of stiffnesses and dampers that were moved."""
    return str(bench_rows("workbench")[0]["sliders"])


def workbench_memory() -> str:
    """By how much an hour of use lets the server grow."""
    (row,) = (row for row in bench_rows("workbench") if "grown_mb" in row)
    return f"{row['grown_mb']:.0f} MB, from {row['before_mb']:.0f} MB"


def gallery_table() -> str:
    """Core seconds until the first frame of each machine of the gallery."""
    rows = [
        (row["machine"], str(row["runs"]), *(f"{row[k]:.1f}" for k in ("core_s", "core_s_max")))
        for row in bench_rows("gallery")
    ]
    return table(("Machine", "Runs", "Median [core s]", "Largest [core s]"), rows)


FIGURES = {
    "gallery-table": gallery_table,
    "workbench-table": workbench_table,
    "workbench-memory": workbench_memory,
    "workbench-parameters": workbench_parameters,
}
