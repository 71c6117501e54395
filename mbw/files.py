"""Output files: targets are checked before the computation, and written whole or not at all."""

from collections.abc import Iterable
from pathlib import Path

import typer

from identification.words import InputError
from identification.words.file_access import write_text
from tuning import write_atomically


def page_path(path: Path, out: Path | None, name: str) -> Path:
    """Return the path of a result's page.

    Args:
        path: folder of the result, or a file in it.
        out: an .html file or a folder; None for the folder of the result.
        name: file name of the page in a folder.
    """
    target = out or (path if path.is_dir() else path.parent)
    return target if target.suffix == ".html" else target / name


def write_page(text: str, target: Path) -> None:
    """Write a page, whole or not at all; replace a file of that name.

    Raises:
        InputError: the page cannot be written.
    """
    with write_atomically(target.parent) as place:
        (place / target.name).write_text(text, encoding="utf-8")


def check_output_folder(folder: Path, names: Iterable[str]) -> None:
    """Refuse a folder into which a result cannot be written, before the computation starts.

    The check creates the folder and removes it again, so that an interrupted run leaves no empty
    folder.

    Args:
        folder: folder of the result.
        names: file names that the result will have.

    Raises:
        InputError: the folder cannot be created or written, or a folder bears a file's name.
    """
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    with write_atomically(folder) as place:
        for name in names:
            if (folder / name).is_dir():
                raise InputError(
                    f"{folder / name} is a folder, but the result has a file of that name: name "
                    "another output folder"
                )
        (place / ".probe").touch()
        (place / ".probe").unlink()
    for path in missing:
        path.rmdir()


def check_json_target(target: Path) -> None:
    """Refuse a JSON target whose folder does not exist, before the computation starts.

    Raises:
        InputError: the target cannot be written.
    """
    if str(target) != "-" and (target.is_dir() or not target.absolute().parent.is_dir()):
        raise InputError(f"{target} cannot be written: name a file in a folder that exists")


def write_json(text: str, target: Path) -> None:
    """Write JSON to a file, or to stdout if the target is ``-``.

    Raises:
        InputError: the file cannot be written.
    """
    if str(target) == "-":
        typer.echo(text)
        return
    write_text(target, text + "\n")
