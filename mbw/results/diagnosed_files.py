"""Result of ``mbw diagnose``, written as three JSON files and arrays, and read back.

Machine of a diagnosis as rows and arrays, from which the page can be drawn without the MJCF.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from diagnosis import Verdict
from diagnosis.inference.evidence import Evidence
from identification.readers.result_files import (
    read_result_arrays,
    read_result_json,
    write_result_arrays,
)
from identification.words import InputError, Layout
from mbmodel import WORLD, Machine, MachineGeometry
from mbmodel.geometry.surfaces import Surface, TendonLine
from mbw.results.diagnosed_schema import LineRow, MachineRow, MeshRow, PlaceRow, ShownFile
from tuning import POSTERIOR_NPZ
from tuning.control_loops.loops_file import LOOPS_JSON
from tuning.files.plant_folder import ARRAYS, AUGMENTED, DIAGNOSE_VERB, SHOWN, VERDICT

EVIDENCE, PAGE = "evidence.json", "report.html"
CHECKPOINT = "diagnose.checkpoint.json"
_MOST_ALTERNATIVES = 19  # of a probability of 5 % or more, beside the plant itself
ALTERNATIVES = tuple(  # MJCF and posterior of each plant that may be there in place of AUGMENTED
    f"alternative{number}.{suffix}"
    for number in range(1, _MOST_ALTERNATIVES + 1)
    for suffix in ("xml", "npz")
)
NAMES = (
    *(VERDICT, EVIDENCE, SHOWN, ARRAYS, AUGMENTED, POSTERIOR_NPZ, LOOPS_JSON, PAGE),
    *ALTERNATIVES,
)


@dataclass(frozen=True, eq=False)
class StoredDiagnosis:
    """Diagnosis as its folder holds it.

    Args:
        verdict: content of verdict.json.
        evidence: content of evidence.json, the evidence of the verdict.
        shown: content of diagnosis.json, names and labels.
        arrays: content of diagnosis.npz. FRFs are (n_freq, n_channel): ``measured``, ``retuned``
            and ``after``, the last without columns if there is no cause; ``noise`` is one standard
            deviation; ``corrected`` is the measurement without the effect, (n_freq, n_corrected).
            ``retuned_excess``, ``retuned_error``, ``after_excess`` and ``after_error`` are
            (n_channel,), nan if unknown; so is ``channel_noise``.
    """

    verdict: Verdict
    evidence: Evidence
    shown: ShownFile
    arrays: dict[str, Any]

    @property
    def has_after(self) -> bool:
        """Whether there are FRFs with the effect."""
        return bool(self.arrays["after"].size)


def write_files(result: StoredDiagnosis, folder: Path) -> None:
    """Write JSON files and arrays into an existing folder."""
    rows = {VERDICT: result.verdict, EVIDENCE: result.evidence, SHOWN: result.shown}
    for name, row in rows.items():
        (folder / name).write_text(row.model_dump_json(indent=1) + "\n", encoding="utf-8")
    write_result_arrays(folder / ARRAYS, result.arrays)


def read_result(path: Path) -> StoredDiagnosis:
    """Read the result that ``mbw diagnose`` wrote.

    Args:
        path: folder of the result, or a file in it.

    Raises:
        InputError: a file is missing, broken or of another version.
    """
    folder = path if path.is_dir() else path.parent
    verdict = read_result_json(folder / VERDICT, Verdict, DIAGNOSE_VERB)
    evidence = read_result_json(folder / EVIDENCE, Evidence, DIAGNOSE_VERB)
    shown = read_result_json(folder / SHOWN, ShownFile, DIAGNOSE_VERB)
    result = StoredDiagnosis(
        verdict, evidence, shown, read_result_arrays(folder / ARRAYS, DIAGNOSE_VERB)
    )
    try:
        _check(result)
    except (ValueError, KeyError, AttributeError, TypeError, OverflowError) as error:
        raise InputError(
            f"{folder}: {VERDICT}, {SHOWN} and {ARRAYS} do not belong together: run mbw diagnose "
            "again"
        ) from error
    return result


def _check(result: StoredDiagnosis) -> None:
    """Check that rows and arrays have matching sizes.

    Raises:
        ValueError: their sizes differ.
        KeyError: an array is missing.
    """
    shown, arrays = result.shown, result.arrays
    lines, channels = shown.lines, len(shown.channels)
    shapes: dict[str, tuple[int, ...]] = {
        "freq_hz": (lines,),
        "corrected": (lines, len(shown.corrected)),
        **dict.fromkeys(("measured", "retuned", "noise"), (lines, channels)),
        **{
            f"{step}_{name}": (channels,)
            for step in ("retuned", "after")
            for name in ("error", "excess")
        },
        "channel_noise": (channels,),
    }
    for name, shape in shapes.items():
        if arrays[name].shape != shape:
            raise ValueError(f"{name} is {arrays[name].shape}, expected {shape}")
    if arrays["after"].shape not in ((lines, 0), (lines, channels)):
        raise ValueError(f"after is {arrays['after'].shape}")
    count = len(result.verdict.causes)
    if len(shown.means) != count:
        raise ValueError("causes and their meanings differ in number")
    if not all(0 <= row.cause < count for row in shown.established):
        raise ValueError("an established cause has no row")
    restore_machine(shown.machine, arrays)


_SURFACE_ARRAYS = {"vertices": np.float32, "triangles": np.int32, "edges": np.int32}


def machine_rows(layout: Layout, geometry: MachineGeometry) -> tuple[MachineRow, dict[str, Any]]:
    """Return the names of a machine as a row, and its numbers as arrays by name."""
    row = MachineRow(
        bodies=list(layout.bodies),
        points=list(layout.points),
        body_of=layout.body_of.tolist(),
        surfaces=[
            MeshRow(
                stage=surface.stage,
                colour=surface.colour,
                **{name: len(getattr(surface, name)) for name in _SURFACE_ARRAYS},
            )
            for surface in geometry.surfaces
        ],
        lines=[
            LineRow(name=line.name, stages=list(line.stages), colour=line.colour)
            for line in geometry.lines
        ],
        boxed=list(geometry.boxed),
    )
    arrays: dict[str, Any] = {"centres": layout.centres, "positions": layout.positions}
    for name, kind in _SURFACE_ARRAYS.items():
        parts = [np.asarray(getattr(surface, name), kind) for surface in geometry.surfaces]
        width = 2 if name == "edges" else 3
        arrays[name] = np.concatenate([np.zeros((0, width), kind), *parts])
    points = [line.points for line in geometry.lines]
    arrays["line_points"] = np.concatenate([np.zeros((0, 3)), *points])
    return row, arrays


def restore_machine(row: MachineRow, arrays: Mapping[str, Any]) -> tuple[Layout, MachineGeometry]:
    """Restore layout and geometry of a machine from its row and arrays.

    Raises:
        ValueError: row and arrays contradict each other.
        KeyError: an array is missing.
    """
    count = len(row.points)
    layout = Layout(
        tuple(row.bodies),
        arrays["centres"],
        tuple(row.points),
        np.array(row.body_of, np.intp),
        arrays["positions"],
        np.broadcast_to(np.eye(3), (count, 3, 3)),
    )
    pieces = {
        name: _split_rows(arrays[name], [getattr(mesh, name) for mesh in row.surfaces])
        for name in _SURFACE_ARRAYS
    }
    surfaces = tuple(
        Surface(
            mesh.stage, **{name: next(parts) for name, parts in pieces.items()}, colour=mesh.colour
        )
        for mesh in row.surfaces
    )
    points = _split_rows(arrays["line_points"], [len(line.stages) for line in row.lines])
    lines = tuple(
        TendonLine(line.name, next(points), tuple(line.stages), line.colour) for line in row.lines
    )
    return layout, MachineGeometry(surfaces, lines, tuple(row.boxed))


def _split_rows(rows: Any, sizes: list[int]) -> Iterator[Any]:
    """Yield consecutive pieces of these sizes."""
    if len(rows) != sum(sizes):
        raise ValueError(f"{len(rows)} rows where {sum(sizes)} are named")
    return iter(np.split(rows, np.cumsum(sizes)[:-1]) if sizes else [])


def place_row(location: str, machine: Machine) -> PlaceRow:
    """Return bodies and points of a location of the verdict.

    Args:
        location: location such as ``joint:ty``.
        machine: machine with its axles.
    """
    layout = machine.layout
    kind, _, name = location.partition(":")
    if kind == "joint":
        anchors = [axle.anchor for axle in machine.axles if axle.stage == name]
        return _place([name], [np.mean(anchors, axis=0)] if anchors else [])
    if kind == "pair":
        bodies = list_linked(name, layout.bodies)
        ends = [layout.centres[layout.bodies.index(body)] for body in bodies]
        row = _place(bodies, [np.mean(ends, axis=0)] if ends else [])
        line = _place(bodies, ends).points if len(ends) > 1 else []  # no line ends at the ground
        return row.model_copy(update={"line": line})
    if kind == "body":
        bodies = [name] if name in layout.bodies else []
        return _place(bodies, [layout.centres[layout.bodies.index(body)] for body in bodies])
    sites = [site for site in name.split("+") if site in layout.points]
    places = [layout.positions[layout.points.index(site)] for site in sites]
    return _place([layout.body_name(site) for site in sites], places)


def _place(bodies: list[str], points: list[Any]) -> PlaceRow:
    return PlaceRow(
        bodies=list(dict.fromkeys(bodies)),
        points=[(float(x), float(y), float(z)) for x, y, z in points],
    )


def list_linked(name: str, bodies: Sequence[str]) -> list[str]:
    """Return the bodies of ``lower-upper``, whose names may contain hyphens themselves.

    Args:
        name: of the pair; the lower one may be the ground, ``world``, which is not returned.
        bodies: all bodies.
    """
    pairs = (
        [lower, upper]
        for lower in (*bodies, WORLD)
        for upper in bodies
        if name == f"{lower}-{upper}"
    )
    return [body for body in next(pairs, []) if body in bodies]
