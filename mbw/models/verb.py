"""``mbw models``: a table of the models of a folder, by whether they linearise."""

import sys
from pathlib import Path

from identification.readers.result_files import ResultFile, ResultRow
from identification.words import InputError, WorkbenchError
from mbmodel import dynamics_error, load_machine
from mbmodel.mjcf.source_files import is_model
from mbw.files import write_json
from mbw.messages import SCREEN


class ModelRow(ResultRow):
    """A model of the folder.

    Args:
        model: path relative to the folder.
        coordinates: number of its coordinates; null without a linear model.
        error: largest difference of its accelerations per position and velocity from
            differences of MuJoCo's own, relative to the largest; null for closed chains.
        reason: why it has no linear model; empty if it has one.
    """

    model: str
    coordinates: int | None
    error: float | None
    reason: str


class ModelTable(ResultFile):
    """Models of a folder, by path.

    Args:
        folder: the folder.
        accepted: number of those with a linear model.
        models: one row each.
    """

    folder: str
    accepted: int
    models: list[ModelRow]


def run(folder: Path, *, out: Path | None, json: Path | None, overwrite: bool) -> None:
    """Run the verb with the values of its options, as ``mbw.models.options`` describes them.

    Raises:
        InputError: there is no folder or no model in it, or the JSON cannot be written.
    """
    if out is not None and out.exists() and not overwrite:
        raise InputError(f"{out} exists: name another file with --out, or add --overwrite")
    paths = sorted(
        path
        for path in folder.rglob("*")
        if path.suffix.lower() in (".xml", ".urdf") and is_model(path)
    )
    if not paths:
        raise InputError(f"{folder} holds no MJCF or URDF: name the folder of some models")
    rows = []
    for path in paths:
        with SCREEN.status(f"{path.relative_to(folder)}"):
            rows.append(_row(path, folder))
        if json != Path("-") and out is None:
            sys.stdout.write(_line(rows[-1]))
    accepted = sum(row.coordinates is not None for row in rows)
    SCREEN.say(f"{accepted} of {len(rows)} models have a linear model")
    if out is not None:
        out.write_text("".join(map(_line, rows)), encoding="utf-8")
    if json is not None:
        table = ModelTable(folder=str(folder), accepted=accepted, models=rows)
        write_json(table.model_dump_json(indent=1), json)


def _row(path: Path, folder: Path) -> ModelRow:
    """Return the row of one model."""
    name = path.relative_to(folder).as_posix()
    try:
        machine = load_machine(path, follow=None)
    except WorkbenchError as failure:
        reason = str(failure).removeprefix(str(path)).lstrip(":, ")
        return ModelRow(model=name, coordinates=None, error=None, reason=reason)
    return ModelRow(
        model=name,
        coordinates=len(machine.coordinates),
        error=dynamics_error(machine),
        reason="",
    )


def _line(row: ModelRow) -> str:
    """Return the line of a model: name, coordinates, error, or the reason."""
    if row.coordinates is None:
        return f"{row.model}\tno\t{row.reason}\n"
    error = "closed chain" if row.error is None else f"{row.error:.1e} off MuJoCo's differences"
    noun = "coordinate" if row.coordinates == 1 else "coordinates"
    return f"{row.model}\t{row.coordinates} {noun}\t{error}\n"
