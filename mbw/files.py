"""Files that results go to: checked before the work is done, written whole or not at all."""

from collections.abc import Iterable
from pathlib import Path

import typer

from identification.words import InputError
from tuning import files_of


def page_file(path: Path, out: Path | None, name: str) -> Path:
    """Where the page of a result goes.

    Args:
        path: the result, a folder or a file in it.
        out: an .html file or a folder; the result's own folder if None.
        name: of the page in a folder.
    """
    target = out or (path if path.is_dir() else path.parent)
    return target if target.suffix == ".html" else target / name


def write_page(text: str, target: Path) -> None:
    """Write a page, whole or not at all, in the place of one of that name.

    Raises:
        InputError: it cannot be written.
    """
    try:
        with files_of(target.parent) as place:
            (place / target.name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{target} cannot be written ({error.strerror}): name another") from error


def check_names(folder: Path, names: Iterable[str]) -> None:
    """Refuse a folder into which a result cannot be written, before the work is done.

    What was made to try it goes again: work that is interrupted leaves no empty folder.

    Raises:
        InputError: it cannot be made or written, or holds folders in the places of the files.
    """
    made = [one for one in (folder, *folder.parents) if not one.exists()]
    with files_of(folder) as place:
        for name in names:
            if (folder / name).is_dir():
                raise InputError(f"{folder / name} is a folder: name another")
        (place / ".probe").touch()
        (place / ".probe").unlink()
    for one in made:
        one.rmdir()


def check_json(target: Path) -> None:
    """Refuse a JSON target whose folder is not there, before the work is done.

    Raises:
        InputError: it cannot be written.
    """
    if str(target) != "-" and (target.is_dir() or not target.absolute().parent.is_dir()):
        raise InputError(f"{target} cannot be written: name a file in a folder that exists")


def write_json(text: str, target: Path) -> None:
    """Write JSON to a file, or to stdout for ``-``.

    Raises:
        InputError: the file cannot be written.
    """
    if str(target) == "-":
        typer.echo(text)
        return
    try:
        target.write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{target} cannot be written ({error.strerror}): name another") from error
