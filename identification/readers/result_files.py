"""Result files of the workbench, read back: JSON under its schema, and arrays of an .npz.

A result may have been altered, cut or written by another version. Whatever is wrong becomes one
sentence that names the file and the verb that writes it anew.
"""

from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel, ValidationError

from identification.words import InputError
from identification.words.file_access import check_file, read_bytes

ResultModel = TypeVar("ResultModel", bound=BaseModel)


def read_result_json(path: Path, model: type[ResultModel], verb: str) -> ResultModel:
    """Read a JSON file and check every key against its schema.

    Args:
        path: the file.
        model: schema of its content.
        verb: verb that writes it, such as ``mbw tune``.

    Raises:
        InputError: the file is missing, or is not JSON of this schema.
    """
    content = read_bytes(path, f"name a folder that {verb} wrote")
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
        path: the file.
        verb: verb that writes it, such as ``mbw tune``.

    Raises:
        InputError: the file is missing or broken.
    """
    check_file(path, f"name a folder that {verb} wrote")
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    except Exception as error:  # on broken bytes numpy and zipfile raise errors of many types
        raise InputError(
            f"{path} is broken or of another version ({type(error).__name__}): run {verb} again"
        ) from error
