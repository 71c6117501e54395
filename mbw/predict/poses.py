"""``mbw predict --poses``: a machine along its stroke, and its files for gain scheduling."""

import math
from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np
import scipy.io
import typer

from identification.readers.csv_tables import read_number_table
from identification.readers.result_files import ResultFile, ResultRow, write_result_arrays
from identification.words import UsageError
from mbw.files import write_json
from mbw.messages import SCREEN
from mbw.option_texts import parse_spin_rates
from mbw.output_folder import ResultOptions
from mbw.predict.requests import PredictRequest, band_lines, read_quantity
from tuning.plant.pose_grid import GridPoint, GridRequest, PoseGrid, pose_grid

POSES_NPZ, POSES_MAT = "poses.npz", "poses.mat"
_MAX_GRID_POINTS = 2000  # of a grid: each is linearised anew
_SHOWN_MODES = 10  # that change most


class PoseLoopRow(ResultRow):
    """Margins of a loop at a point: modulus, phase [deg], gain and crossover [Hz]."""

    loop: str
    modulus: float
    phase: float | None
    gain: float | None
    crossover: float | None


class PoseRow(ResultRow):
    """A point of the grid.

    Args:
        pose: moves of joints [m, rad].
        spin: rates of hinges [rad/s].
        frequencies: of the modes, each in its place over the grid; null without a counterpart [Hz].
        loops: margins; empty without a budget, or where the loops are unstable.
        is_stable: whether the loops are stable; null without a budget.
    """

    pose: dict[str, float]
    spin: dict[str, float]
    frequencies: list[float | None]
    loops: list[PoseLoopRow]
    is_stable: bool | None


class PosesFile(ResultFile):
    """Result of ``mbw predict --poses``: the points, and the number of the worst one, from 0."""

    points: list[PoseRow]
    worst: int


def has_ranges(poses: Sequence[str], spin: Sequence[str]) -> bool:
    """Return whether a grid is asked for: poses, or a spin ``JOINT=FROM:TO:N``."""
    return bool(poses) or any(":" in text.rpartition("=")[2] for text in spin)


def parse_grid(poses: Sequence[str], spin: Sequence[str]) -> list[GridPoint]:
    """Return the points of a grid: all combinations of the ranges, with every row of files.

    Args:
        poses: texts ``JOINT=FROM:TO:N``, or paths of a CSV with a joint's name over each column.
        spin: texts ``JOINT=RATE`` or ``JOINT=FROM:TO:N``.

    Raises:
        UsageError: a text is neither, or a joint stands twice.
        InputError: a file cannot be read.
    """
    axes = [
        _parse_range("--poses", text) if "=" in text else _read_poses(Path(text)) for text in poses
    ]
    ranged = [text for text in spin if ":" in text.rpartition("=")[2]]
    rates = [_parse_range("--spin", text) for text in ranged]
    steady = parse_spin_rates([text for text in spin if text not in ranged])
    count = math.prod(len(axis) for axis in (*axes, *rates))
    names = [name for axis in (*axes, *rates) for name in axis[0]]
    if len(set(names)) < len(names):
        raise UsageError("--poses and --spin name a joint twice: give it one range")
    if count > _MAX_GRID_POINTS:
        raise UsageError(f"the grid has {count} points: give at most {_MAX_GRID_POINTS}")
    return [
        GridPoint(
            {name: value for part in chosen[: len(axes)] for name, value in part.items()},
            {**steady, **{n: v for part in chosen[len(axes) :] for n, v in part.items()}},
        )
        for chosen in product(*axes, *rates)
    ]


def _parse_range(option: str, text: str) -> list[dict[str, float]]:
    """Return the values of a text ``JOINT=FROM:TO:N``."""
    joint, _, span = text.rpartition("=")
    parts = span.split(":")
    try:
        low, high, count = float(parts[0]), float(parts[1]), int(parts[2])
    except (ValueError, IndexError):
        low, high, count = math.nan, math.nan, 0
    if not (joint and len(parts) == 3 and math.isfinite(low + high) and count >= 1):
        raise UsageError(
            f"{option} {text!r}: write JOINT=FROM:TO:N, such as ty_ty=-0.05:0.05:11"
            + (", or name a CSV with a joint over each column" if option == "--poses" else "")
        )
    return [{joint: float(value)} for value in np.linspace(low, high, count)]


def _read_poses(path: Path) -> list[dict[str, float]]:
    """Return the rows of a CSV of poses."""
    joints, table = read_number_table(path, "give a CSV of poses [m, rad], a joint a column")
    return [dict(zip(joints, row, strict=True)) for row in table.tolist()]


def predict_poses(
    path: Path,
    points: Sequence[GridPoint],
    request: PredictRequest,
    budget: Path | None,
    key: str | None,
    options: ResultOptions,
) -> None:
    """Compute a grid of poses, write it, and print modes, margins and the worst pose.

    Args:
        path: MJCF of the machine.
        points: of the grid.
        request: ports and lines.
        budget: budget.toml whose loops have margins; None for none.
        key: keyframe from which the poses move.
        options: where the files go.

    Raises:
        UsageError: a label or quantity that cannot be used.
        InputError: a pose that the machine does not have.
    """
    quantity = None if request.quantity is None else read_quantity(request)
    lines = band_lines(request)
    if request.band is None:  # a free hinge, as a spindle has, has no response at 0 Hz
        lines = lines[lines > 0]
    ports = tuple(request.outputs), tuple(request.inputs)
    asked = GridRequest(*ports, lines, quantity, budget)
    with options.open("predict", path, "predicted", (POSES_NPZ, POSES_MAT)) as output:
        with SCREEN.status(f"{len(points)} poses"):
            grid = pose_grid(path, points, asked, key)
        with output.write() as place:
            arrays = grid_arrays(grid)
            write_result_arrays(place / POSES_NPZ, arrays)
            scipy.io.savemat(place / POSES_MAT, {k: _for_matlab(v) for k, v in arrays.items()})
    for line in grid_lines(grid):
        (SCREEN.say if options.has_json_on_stdout else typer.echo)(line)
    SCREEN.say(f"grid for gain scheduling: {output.path / POSES_NPZ}, {POSES_MAT}")
    if options.json is not None:
        write_json(_result(grid).model_dump_json(indent=1), options.json)


def grid_arrays(grid: PoseGrid) -> dict[str, np.ndarray]:
    """Return the arrays of a grid: points, modes, FRFs, state spaces and margins, by name."""
    request, first = grid.request, grid.points[0]
    arrays = {
        "joints": np.array([*first.pose]),
        "poses": np.array([[*point.pose.values()] for point in grid.points]),
        "spin_joints": np.array([*first.spin]),
        "spin": np.array([[*point.spin.values()] for point in grid.points]),
        "poles": grid.poles,
        "mode_freq_hz": grid.freq_hz,
    }
    if grid.systems:
        a, b, c, d = (np.array(each) for each in zip(*grid.systems, strict=True))
        names = {"outputs": request.outputs, "inputs": request.inputs, "states": grid.state_labels}
        arrays |= {"A": a, "B": b, "C": c, "D": d, "freq_hz": request.freq_hz, "frf": grid.frfs}
        arrays |= {name: np.array(labels) for name, labels in names.items()}
    if grid.loops:
        arrays |= {"loops": np.array(grid.loops), "modulus": grid.modulus}
    return arrays


def _for_matlab(array: np.ndarray) -> np.ndarray:
    """Return an array whose texts MATLAB reads as a cell array."""
    return array.astype(object) if array.dtype.kind == "U" else array


def grid_lines(grid: PoseGrid) -> list[str]:
    """Return the table of the modes that change most, margins, and the worst pose."""
    freq, worst = grid.freq_hz, grid.worst
    low, high = np.nanmin(freq, axis=0), np.nanmax(freq, axis=0)
    chosen = np.sort(np.argsort(low / high, kind="stable")[:_SHOWN_MODES])
    lines = [f"{len(grid.points)} points; modes that change most, from least to largest [Hz]:"]
    lines += [
        f"  {low[k]:10.4g} {high[k]:10.4g}  {100 * (high[k] / low[k] - 1):6.2f} %" for k in chosen
    ]
    for point, margins, pole in zip(grid.points, grid.margins, grid.growing, strict=False):
        if margins is None:
            growth = 0.0 if pole is None else abs(pole.imag) / (2 * np.pi)
            lines.append(f"{point}: unstable, a pole at {growth:.4g} Hz grows")
        else:
            each = zip(grid.loops, margins.loops, strict=True)
            lines += [f"{point}: {name}: {loop!r}" for name, loop in each]
    if len(grid.points) > 1:
        reason = "the smallest margin" if grid.margins else "the modes farthest from the median"
        if grid.margins and grid.margins[worst] is None:
            reason = "the fastest growth"
        lines.append(f"worst pose: {grid.points[worst]}, with {reason}")
    return lines


def _result(grid: PoseGrid) -> PosesFile:
    """Return the content of the JSON file."""
    rows = []
    for number, point in enumerate(grid.points):
        margins = grid.margins[number] if grid.margins else None
        loops = [
            PoseLoopRow(
                loop=name,
                modulus=loop.modulus.value,
                **loop.state(("phase", "gain", "crossover")),
            )
            for name, loop in zip(grid.loops, margins.loops if margins else (), strict=False)
        ]
        rows.append(
            PoseRow(
                pose=dict(point.pose),
                spin=dict(point.spin),
                frequencies=[None if np.isnan(f) else float(f) for f in grid.freq_hz[number]],
                loops=loops,
                is_stable=None if not grid.loops else margins is not None,
            )
        )
    return PosesFile(points=rows, worst=grid.worst)
