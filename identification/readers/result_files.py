"""Result files of the workbench: JSON under its schema, and arrays of an .npz.

Each states its format, a number that grows when older versions could misread a file; files of
versions before 0.2 state none, which counts as 0. A result may have been altered, cut or written by
another version. Whatever is wrong becomes one sentence that names the file and what to do.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from identification.words import InputError
from identification.words.file_access import check_file, read_bytes

FORMAT = 1  # of files that are written, and the newest that is read

ResultModel = TypeVar("ResultModel", bound=BaseModel)


class ResultRow(BaseModel):
    """Part of a result: JSON without NaN, made from keywords or from a record's attributes."""

    model_config = ConfigDict(allow_inf_nan=False, from_attributes=True)


class StrictRow(ResultRow):
    """Part of a result that refuses unknown keys and does not change."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class ResultFile(ResultRow):
    """Top level of a JSON file, with its format first."""

    format: int = FORMAT

    def model_post_init(self, context: Any) -> None:
        """Count the format as set, so that it is always written."""
        self.model_fields_set.add("format")


def json_text(content: BaseModel) -> str:
    """Return a result as JSON; keys that were never set do not apply to it and are left out."""
    return content.model_dump_json(indent=1, exclude_unset=True)


def check_format(stated: object, path: Path) -> None:
    """Refuse a file of a newer format.

    Args:
        stated: format that the file states; None or 0 of files before version 0.2.

    Raises:
        InputError: this version does not know the format.
    """
    if stated in (None, *range(FORMAT + 1)):
        return
    raise InputError(
        f"{path} has format {stated}, and this version reads formats up to {FORMAT}: install a "
        "newer mbworkbench"
    )


def write_result_arrays(path: Path | BinaryIO, arrays: Mapping[str, Any]) -> None:
    """Write arrays and the format to an .npz file.

    Args:
        path: the file, or a stream.
        arrays: by name.
    """
    np.savez_compressed(path, allow_pickle=False, **arrays, format=np.array(FORMAT))


def read_result_json(path: Path, model: type[ResultModel], verb: str) -> ResultModel:
    """Read a JSON file and check every key against its schema.

    Args:
        model: schema of its content.
        verb: verb that writes it, such as ``mbw tune``.

    Raises:
        InputError: the file is missing, or is not JSON of this schema.
    """
    content = read_bytes(path, f"name a folder that {verb} wrote")
    check_format(_stated_format(content), path)
    try:
        return model.model_validate_json(content)
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        where = ".".join(map(str, fault["loc"]))
        raise InputError(
            f"{path} is broken or of another version ({where}{': ' if where else ''}"
            f"{fault['msg']}): run {verb} again"
        ) from error


def read_result_arrays(path: Path, verb: str) -> dict[str, Any]:
    """Read all arrays of an .npz file.

    Args:
        verb: verb that writes it, such as ``mbw tune``.

    Raises:
        InputError: the file is missing or broken.
    """
    check_file(path, f"name a folder that {verb} wrote")
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        check_format(arrays.pop("format", np.array(0)).item(), path)
        return arrays
    except InputError:
        raise
    except Exception as error:  # on broken bytes numpy and zipfile raise errors of many types
        raise InputError(
            f"{path} is broken or of another version ({type(error).__name__}): run {verb} again"
        ) from error


def _stated_format(content: bytes) -> object:
    """Return the format that a JSON file states; None if it states none, or is no JSON."""
    try:
        return json.loads(content).get("format")
    except (AttributeError, ValueError, RecursionError):
        return None
