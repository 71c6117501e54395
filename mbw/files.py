"""Output files: targets are checked before the computation, and written whole or not at all.

Arrays with names in a file: .npz for Python, .mat for MATLAB.
"""

from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
import scipy.io
import typer

from identification.readers.result_files import write_result_arrays
from identification.words import InputError
from identification.words.file_access import write_bytes, write_text


def page_path(target: Path, name: str) -> Path:
    """Return the path of a result's page.

    Args:
        target: an .html file or a folder.
        name: file name of the page in a folder.
    """
    return target if target.suffix == ".html" else target / name


def check_json_target(target: Path) -> None:
    """Refuse a JSON target whose folder does not exist, before the computation starts.

    Raises:
        InputError: the target cannot be written.
    """
    if str(target) != "-" and (target.is_dir() or not target.absolute().parent.is_dir()):
        raise InputError(f"{target} cannot be written: name a file in a folder that exists")


def write_json(text: str, target: Path | None) -> None:
    """Write JSON to a file, or to stdout if the target is ``-``; nowhere if it is None.

    Raises:
        InputError: the file cannot be written.
    """
    if str(target) == "-":
        typer.echo(text)
    elif target is not None:
        write_text(target, text + "\n")


def write_named_arrays(
    target: Path, arrays: Mapping[str, np.ndarray], texts: Mapping[str, Sequence[str] | str]
) -> None:
    """Write arrays and texts; lists of texts are cell arrays in MATLAB.

    Args:
        target: .npz or .mat.
        arrays: by name.
        texts: a text, or a list of texts, by name.

    Raises:
        InputError: the file cannot be written.
    """
    content = BytesIO()
    if target.suffix == ".mat":
        cells = {
            key: value if isinstance(value, str) else np.array(list(value), object)
            for key, value in texts.items()
        }
        scipy.io.savemat(content, {**arrays, **cells})
    else:
        words = {key: np.array(value) for key, value in texts.items()}
        write_result_arrays(content, {**arrays, **words})
    write_bytes(target, content.getvalue())
