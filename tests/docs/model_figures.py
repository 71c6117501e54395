"""Figures of the benches of the model: FRFs and their gradient."""

from tests.docs.formats import significant, table
from tests.docs.results import bench_rows

FRF_ROWS = {
    "FRFs, ours": "FRFs, this project",
    "FRFs and gradient, ours": "FRFs and gradient, this project",
    "the same by 73 evaluations of python-control with slycot": (
        "FRFs and gradient by 73 evaluations of python-control with slycot"
    ),
}


def frf_table() -> str:
    """Speed and error of FRFs and gradient on the station."""
    rows = [
        (
            FRF_ROWS.get(row["work"], row["work"]),
            significant(row["ms"]),
            significant(row["times ours"]),
            "" if row["worst error"] == "" else f"{row['worst error']:.1e}",
        )
        for row in bench_rows("frf")
    ]
    return table(("Work", "Time [ms]", "Time / this project's", "Largest error"), rows)


def frf_ratio(work: str) -> str:
    """Return how many times longer some work takes than this project's."""
    ratios = {row["work"]: row["times ours"] for row in bench_rows("frf")}
    return significant(ratios[work], 2)


def frf_gradient_ms() -> str:
    """Milliseconds for the FRFs and the gradient of the station."""
    times = {row["work"]: row["ms"] for row in bench_rows("frf")}
    return significant(times["FRFs and gradient, ours"], 2)


def frf_error() -> str:
    """Largest error of this project's FRFs against 40 digits."""
    return f"{bench_rows('frf')[0]['worst error']:.1e}"


def large_table() -> str:
    """Speed and memory of FRFs and gradient on a machine of 60 bodies."""
    rows = [
        (
            row["work"].replace(", ours", ", this project"),
            significant(row["s"]),
            significant(row["times ours"]),
            row["peak memory"],
        )
        for row in bench_rows("large")
    ]
    return table(("Work", "Time [s]", "Time / this project's", "Peak memory"), rows)


def large_test_table() -> str:
    """Core seconds, peak memory and modes found of large hammer tests."""
    rows = [
        (
            f"{row['channels']} x {row['references']} x {row['lines']}",
            f"{row['found']} of {row['modes']}",
            row["extra"],
            significant(row["rms error over deviation"], 2),
            significant(row["core s"], 2),
            significant(row["peak GB"], 2),
        )
        for row in bench_rows("large_identify")
    ]
    header = ("Channels x references x lines", "Modes found", "Extra", "Error / deviation")
    return table((*header, "Core seconds", "Peak memory [GB]"), rows)


def large_test_size() -> str:
    """Return the size of the largest test in words."""
    row = bench_rows("large_identify")[-1]
    return f"{row['channels']} channels, {row['references']} references and {row['lines']} lines"


def large_test_figure(key: str) -> str:
    """Return core seconds or peak memory of the largest test."""
    return significant(bench_rows("large_identify")[-1][key], 2)


def machine_size_table() -> str:
    """Core seconds and peak memory by the number of bodies, with their exponents."""
    steps = {"model": "Model", "frfs": "FRFs and gradient", "step": "Gauss-Newton step"}
    keys = [f"{step} {unit}" for step in steps for unit in ("s", "GiB")]
    rows = [
        (
            "Exponent" if row["bodies"] == "exponent" else row["bodies"],
            significant(row["parameters"], 2)
            if row["bodies"] == "exponent"
            else round(row["parameters"]),
            *(significant(row[key], 2) for key in keys),
        )
        for row in bench_rows("machine_size")
    ]
    header = [f"{name} [{unit}]" for name in steps.values() for unit in ("s", "GiB")]
    return table(("Bodies", "Parameters", *header), rows)


def machine_size_memory() -> str:
    """Largest memory of a step with 200 bodies [GiB]."""
    return significant(bench_rows("machine_size")[-2]["step GiB"], 2)


def written_models_summary(kind: str) -> str:
    """Return how many written trees or files are the machine in memory."""
    rows = [
        row
        for row in bench_rows("written_models")
        if row["machine"].startswith("tree ") == (kind == "trees")
    ]
    return f"{sum(row['right'] for row in rows)} of {len(rows)}"


FIGURES = {
    "written-models-trees": lambda: written_models_summary("trees"),
    "written-models-files": lambda: written_models_summary("files"),
    "written-models-difference": lambda: significant(
        max(row["difference"] for row in bench_rows("written_models")), 2
    ),
    "machine-size-table": machine_size_table,
    "machine-size-memory": machine_size_memory,
    "frf-table": frf_table,
    "frf-times-control": lambda: frf_ratio("FRFs, python-control"),
    "frf-times-slycot": lambda: frf_ratio("FRFs, python-control with slycot"),
    "frf-gradient-times-slycot": lambda: frf_ratio(
        "the same by 73 evaluations of python-control with slycot"
    ),
    "frf-gradient-ms": frf_gradient_ms,
    "frf-error": frf_error,
    "large-table": large_table,
    "large-test-table": large_test_table,
    "large-test-size": large_test_size,
    "large-test-seconds": lambda: large_test_figure("core s"),
    "large-test-memory": lambda: large_test_figure("peak GB"),
    "large-seconds": lambda: significant(bench_rows("large")[0]["s"], 2),
}
