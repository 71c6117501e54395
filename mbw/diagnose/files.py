"""The files of ``mbw diagnose``, written and read: three of JSON, arrays, an MJCF, the page."""

import zlib
from pathlib import Path
from typing import Any, TypeVar
from zipfile import BadZipFile

import numpy as np
from pydantic import BaseModel, ValidationError

from diagnosis import Diagnosis, Verdict
from diagnosis.inference.evidence import Evidence
from identification.words import InputError
from mbmodel import NotHeld, write_mjcf
from mbw.diagnose.machine_rows import machine_of
from mbw.diagnose.result import Result
from mbw.diagnose.schema import ShownFile

VERDICT, EVIDENCE = "verdict.json", "evidence.json"
SHOWN, ARRAYS, PAGE = "diagnosis.json", "diagnosis.npz", "report.html"
AUGMENTED = "augmented.xml"
NAMES = (VERDICT, EVIDENCE, SHOWN, ARRAYS, AUGMENTED, PAGE)

Row = TypeVar("Row", bound=BaseModel)


def write_files(result: Result, folder: Path) -> None:
    """Write all but the page into a folder that is there."""
    rows = {VERDICT: result.verdict, EVIDENCE: result.evidence, SHOWN: result.shown}
    for name, row in rows.items():
        (folder / name).write_text(row.model_dump_json(indent=1) + "\n", encoding="utf-8")
    np.savez_compressed(folder / ARRAYS, allow_pickle=False, **result.arrays)


def write_augmented(found: Diagnosis, target: Path) -> tuple[NotHeld, ...]:
    """Write the MJCF, tuned, with what was found to be missing; return what it does not hold."""
    level = found.after or found.retuned
    theta = found.known.theta if found.known else level.theta
    model = level.refit.session.model
    return write_mjcf(model.machine.source, target, model.edits(theta))


def read_result(path: Path) -> Result:
    """Read what ``mbw diagnose`` wrote.

    Args:
        path: the folder, or a file of it.

    Raises:
        InputError: a file that is missing, broken or of another version.
    """
    folder = path if path.is_dir() else path.parent
    verdict = _row(folder / VERDICT, Verdict)
    evidence = _row(folder / EVIDENCE, Evidence)
    shown = _row(folder / SHOWN, ShownFile)
    result = Result(verdict, evidence, shown, _arrays(folder / ARRAYS))
    try:
        _check(result)
    except (ValueError, KeyError, AttributeError) as error:
        raise InputError(
            f"{folder}: {VERDICT}, {SHOWN} and {ARRAYS} do not belong together: run mbw diagnose "
            "again"
        ) from error
    return result


def _row(path: Path, kind: type[Row]) -> Row:
    try:
        return kind.model_validate_json(path.read_bytes())
    except (ValidationError, OSError) as error:
        raise _refused(path) from error


def _arrays(path: Path) -> dict[str, Any]:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    except (OSError, EOFError, ValueError, AttributeError, BadZipFile, zlib.error) as error:
        raise _refused(path) from error


def _refused(path: Path) -> InputError:
    if not path.exists():
        return InputError(f"{path} does not exist: name the folder that mbw diagnose wrote")
    return InputError(f"{path} is broken or of another version: run mbw diagnose again")


def _check(result: Result) -> None:
    """Rows and arrays are of one size.

    Raises:
        ValueError: they are not.
        KeyError: an array is missing.
    """
    shown, arrays = result.shown, result.arrays
    lines, channels = shown.lines, len(shown.channels)
    shapes: dict[str, tuple[int, ...]] = {
        "freq_hz": (lines,),
        "corrected": (lines, len(shown.corrected)),
        **dict.fromkeys(("measured", "retuned", "noise"), (lines, channels)),
        **{f"{of}_{what}": (channels,) for of in ("retuned", "after") for what in _EACH},
        "channel_noise": (channels,),
    }
    for name, shape in shapes.items():
        if arrays[name].shape != shape:
            raise ValueError(f"{name} is {arrays[name].shape}, expected {shape}")
    if arrays["after"].shape not in ((lines, 0), (lines, channels)):
        raise ValueError(f"after is {arrays['after'].shape}")
    if len(shown.means) != len(result.verdict.causes):
        raise ValueError("causes and their meanings differ in number")
    machine_of(shown.machine, arrays)


_EACH = ("error", "excess")
