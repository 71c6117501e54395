"""Figures of the bench of the workbench's latency."""

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
    ]
    return table(("Case", "Inputs", "Median [ms]", "95 % [ms]", "Largest [ms]"), rows)


def workbench_parameters() -> str:
    """Number of stiffnesses and dampers that were moved."""
    return str(bench_rows("workbench")[0]["sliders"])


FIGURES = {
    "workbench-table": workbench_table,
    "workbench-parameters": workbench_parameters,
}
