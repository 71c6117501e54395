"""Figures of the benches of tuning."""

import statistics

from tests.docs.formats import fixed, significant, table
from tests.docs.results import bench_rows

TUNE_COLUMNS = (
    "Campaign",
    "Noise [relative]",
    "Nominal model",
    "Stiffness and damping tuned",
    "Tolerances tuned too",
    "Held-out lines",
    "Largest pull",
)
ALGORITHM_COLUMNS = (
    "First stages",
    "Coordinates",
    "Residual",
    "Last stages",
    "Within 5 % of the best cost",
    "Evaluations",
    "Core s",
)
CAMPAIGNS = {"open/none": "Campaign of another origin"}
WAYS = {
    "ours, 2 threads": "This project, 2 threads",
    "ours, 1 thread": "This project, 1 thread",
    "mujoco.sysid's optimiser": "Optimiser of `mujoco.sysid`",
}


def tune_table() -> str:
    """Excess of tuned models over the noise, on campaigns that lack no effect."""
    rows = [
        (
            CAMPAIGNS.get(row["campaign"], row["campaign"].replace("truth", "Virtual test")),
            fixed(row["noise"], 3),
            fixed(row["excess as drawn"], 1),
            fixed(row["stiffness and damping alone"], 2),
            fixed(row["tolerances too"], 3),
            fixed(row["held out"], 3),
            f"{row['largest pull without bounds']:+.1f}",
        )
        for row in bench_rows("tune")
    ]
    return table(TUNE_COLUMNS, rows)


def tune_held_out() -> str:
    """Least and largest excess on held-out lines."""
    excess = [row["held out"] for row in bench_rows("tune")]
    return f"{min(excess):.3f} to {max(excess):.3f}"


def coverage_table() -> str:
    """Coverage of the 95 % intervals of a tuning."""
    rows = [
        (
            row["of"][0].upper() + row["of"][1:],
            fixed(row["coverage %"], 1),
            f"{row['from']:.1f} to {row['to']:.1f}",
            row["n"],
            row["machines"],
        )
        for row in bench_rows("coverage")
    ]
    header = (
        "95 % interval of",
        "Holds the truth [%]",
        "95 % interval over machines",
        "n",
        "Machines",
    )
    return table(header, rows)


def plant_coverage_table() -> str:
    """Coverage of the bands of FRFs between ports that were not measured."""
    rows = [
        (
            "None" if row["dirt %"] == 0 else f"{row['dirt %']:g} % of the motion",
            row["plant"].capitalize(),
            row["of"].capitalize(),
            fixed(row["coverage %"], 1),
            f"{row['from']:.1f} to {min(row['to'], 100.0):.1f}",
            significant(row["median width %"], 2),
            significant(row["median error %"], 2),
            row["n"],
            row["machines"],
        )
        for row in bench_rows("plant_coverage")
        if row["machines"]
    ]
    header = (
        "Imperfections leave",
        "Plant",
        "Bands of",
        "Hold the truth [%]",
        "95 % interval over machines",
        "Half width, median [%]",
        "Error, median [%]",
        "n",
        "Machines",
    )
    return table(header, rows)


def resume_same() -> str:
    """Number of interrupted runs whose resumed result has the same bits."""
    (row,) = bench_rows("resume")
    return f"{row['the same bits']} of {row['killed']}"


def starts_table() -> str:
    """Convergence and speed from 20 random starts, beside MuJoCo's optimiser."""
    rows = [
        (
            WAYS[row["way"]],
            row["within 5 %"],
            fixed(row["median core s"], 2),
            fixed(row["core s / ours"], 2),
            f"{row['evaluations']:.0f}",
        )
        for row in bench_rows("starts")
    ]
    header = (
        "Optimiser",
        "Within 5 % of the best cost",
        "Median core s",
        "Core s / this project's",
        "Evaluations",
    )
    return table(header, rows)


def starts_ratio() -> str:
    """How many times longer MuJoCo's optimiser takes, median of 20 starts."""
    return significant(bench_rows("starts")[-1]["core s / ours"], 2)


def starts_reached() -> str:
    """Number of starts from which this project reaches the best cost."""
    return str(bench_rows("starts")[0]["within 5 %"])


def algorithms_table() -> str:
    """Algorithms and residuals of the stages of a tuning."""
    rows = [
        (
            f"`{row['opening']}`",
            row["coordinates"].capitalize(),
            row["residual"].replace("by noise alone", "noise weights only").capitalize(),
            f"`{row['finish']}`",
            row["within 5 %"],
            f"{row['evaluations']:.0f}",
            fixed(row["core s"], 1),
        )
        for row in bench_rows("algorithms")
    ]
    return table(ALGORITHM_COLUMNS, rows, text=4)


def nlopt_table() -> str:
    """NLopt beside Gauss-Newton, from each start."""
    rows = [
        (
            row["case"].capitalize(),
            row["start"].capitalize(),
            row["evaluations Gauss-Newton"],
            row["evaluations NLopt"],
            fixed(row["core s Gauss-Newton"], 2),
            fixed(row["core s NLopt"], 2),
            f"{row['cost NLopt / Gauss-Newton - 1']:+.0e}",
        )
        for row in bench_rows("nlopt_starts")
    ]
    header = (
        "Data",
        "Start",
        "Evaluations, Gauss-Newton",
        "Evaluations, NLopt",
        "Core s, Gauss-Newton",
        "Core s, NLopt",
        "Relative difference of the cost",
    )
    return table(header, rows, text=2)


def nlopt_ratio() -> str:
    """Evaluations of NLopt over those of Gauss-Newton: median over all starts."""
    rows = bench_rows("nlopt_starts")
    ratios = [row["evaluations NLopt"] / row["evaluations Gauss-Newton"] for row in rows]
    return fixed(statistics.median(ratios), 2)


def nlopt_worst_ratio() -> str:
    """Evaluations of NLopt over those of Gauss-Newton: the largest of all starts."""
    rows = bench_rows("nlopt_starts")
    ratios = [row["evaluations NLopt"] / row["evaluations Gauss-Newton"] for row in rows]
    return fixed(max(ratios), 2)


def nlopt_core_ratio() -> str:
    """Core seconds of NLopt over those of Gauss-Newton: median over all starts."""
    rows = bench_rows("nlopt_starts")
    return fixed(
        statistics.median(row["core s NLopt"] / row["core s Gauss-Newton"] for row in rows), 2
    )


FIGURES = {
    "nlopt-table": nlopt_table,
    "nlopt-ratio": nlopt_ratio,
    "nlopt-worst-ratio": nlopt_worst_ratio,
    "nlopt-core-ratio": nlopt_core_ratio,
    "tune-table": tune_table,
    "tune-held-out": tune_held_out,
    "coverage-table": coverage_table,
    "plant-coverage-table": plant_coverage_table,
    "resume-same": resume_same,
    "starts-table": starts_table,
    "starts-ratio": starts_ratio,
    "starts-reached": starts_reached,
    "algorithms-table": algorithms_table,
}
