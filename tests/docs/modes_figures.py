"""Figures of the benches of modal identification and of matching modes."""

import numpy as np

from tests.docs.formats import fixed, percent, significant, table
from tests.docs.results import bench_rows

IDENTIFY_COLUMNS = (
    "Seed",
    "Modes",
    "Found",
    "Extra",
    "FRF error [%]",
    "Whole run [s]",
    "Poles [s]",
    "sdypy-EMA: time of poles / this project's",
    "sdypy-EMA: found at best order",
    "pyFBS: time of poles / this project's",
    "pyFBS: found at best order",
)
SURE = 0.9  # pairs with a higher mean probability count as sure


def identify_table() -> str:
    """Modes that are found without manual selection, beside two other packages."""
    rows = [
        (
            row["seed"],
            row["modes"],
            row["found"],
            row["extra"],
            fixed(row["error %"], 2),
            fixed(row["all s"], 1),
            fixed(row["poles s"], 2),
            significant(row["sdypy poles / ours"], 2),
            row["sdypy best order"],
            significant(row["pyFBS poles / ours"], 2),
            row["pyFBS best order"],
        )
        for row in bench_rows("identify")
    ]
    return table(IDENTIFY_COLUMNS, rows)


def identify_found() -> str:
    """Number of modes that are found, of those that are there."""
    rows = bench_rows("identify")
    return f"{sum(row['found'] for row in rows)} of {sum(row['modes'] for row in rows)}"


def identify_extra() -> str:
    """Number of modes that are found and are not there."""
    return str(sum(row["extra"] for row in bench_rows("identify")))


def intervals_table() -> str:
    """Coverage of the 95 % intervals of identified modes."""
    rows = [
        (
            row["of"].capitalize(),
            fixed(row["coverage %"], 1),
            f"{row['from']:.1f} to {row['to']:.1f}",
            row["n"],
        )
        for row in bench_rows("intervals")
    ]
    header = ("95 % interval of", "Holds the truth [%]", "95 % interval over machines", "n")
    return table(header, rows)


def gondola_table() -> str:
    """Pairs of modes that three methods name correctly, of six in the mean."""
    structures = [row for row in bench_rows("gondola") if "structure" in row]
    methods = {
        "This project, signed shapes, one to one": "right",
        "As printed, simulated ratios to the same sensor": "as printed, to the reference",
        "As printed, simulated ratios to each mode's largest": "as printed, to the largest",
    }
    rows = [
        (name, fixed(float(np.mean([row[key] for row in structures])), 1), len(structures))
        for name, key in methods.items()
    ]
    return table(("Method", "Correct pairs of six, mean", "Structures"), rows)


def gondola_stated_table() -> str:
    """How often a statement of a match is true, by its mean probability."""
    kinds = {"a pair": "Pair", "no match": "No match"}
    rows = [
        (kinds[row["stated"]], fixed(row["mean"], 3), percent(row["right"], 0), row["n"])
        for row in bench_rows("gondola")
        if "stated" in row
    ]
    return table(("Statement", "Mean probability", "True", "n"), rows)


def gondola_sure() -> str:
    """Number of true pairs among those that are stated with more than 0.9."""
    return _true_pairs([row for row in _pairs() if row["mean"] > SURE])


def gondola_less_sure() -> str:
    """Number of true pairs among those that are stated with 0.5 to 0.9."""
    return _true_pairs([row for row in _pairs() if 0.5 < row["mean"] < SURE])


def gondola_seconds() -> str:
    """Least and largest core seconds for one structure with all channels."""
    seconds = [row["core s"] for row in bench_rows("gondola") if "structure" in row]
    return f"{min(seconds):.1f} to {max(seconds):.1f}"


def gondola_frames_modes() -> str:
    """Modes of the single frame and the most similar modes of three frames on pins."""
    rows = [
        (
            row["mode"],
            fixed(row["single Hz"], 1),
            row["three"],
            fixed(row["three Hz"], 1),
            fixed(row["MAC"], 2),
        )
        for row in bench_rows("gondola_frames")
        if "mode" in row
    ]
    header = ("Single frame, mode", "Frequency [Hz]", "Three frames, mode", "Frequency [Hz]", "MAC")
    return table(header, rows)


def gondola_frames_table() -> str:
    """Matches of structures of three frames with the shapes of either model."""
    rows = []
    for name in ("single frame", "three frames"):
        own = [row for row in bench_rows("gondola_frames") if row.get("model") == name]
        counts = [
            sum(row[key] for row in own)
            for key in ("measured", "right", "wrong", "wrong above 0.9")
        ]
        rows.append((name.capitalize(), *counts, fixed(_median_of(own, "median MAC"), 2)))
    header = (
        "Model",
        "Measured modes",
        "Right pairs",
        "Wrong pairs",
        "Wrong above 0.9",
        "Median MAC",
    )
    return table(header, rows)


def _median_of(rows: list[dict], key: str) -> float:
    return float(np.median([row[key] for row in rows]))


def _pairs() -> list[dict]:
    return [row for row in bench_rows("gondola") if row.get("stated") == "a pair"]


def _true_pairs(rows: list[dict]) -> str:
    return f"{sum(round(row['right'] * row['n']) for row in rows)} of {sum(r['n'] for r in rows)}"


FIGURES = {
    "identify-table": identify_table,
    "identify-found": identify_found,
    "identify-extra": identify_extra,
    "intervals-table": intervals_table,
    "gondola-table": gondola_table,
    "gondola-stated-table": gondola_stated_table,
    "gondola-sure": gondola_sure,
    "gondola-less-sure": gondola_less_sure,
    "gondola-seconds": gondola_seconds,
    "gondola-frames-modes-table": gondola_frames_modes,
    "gondola-frames-table": gondola_frames_table,
}
