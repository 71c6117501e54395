"""A file written from an MJCF: it is read back and compared before it counts.

The file is written as its author wrote it, with other numbers. Where its settings, classes or
included files would make another machine of it, it is written in expanded form, in which every
element states its own values. A file that differs even then is kept, and named as wrong.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from uuid import uuid4

import mujoco

from identification.words import ConvergenceError, InputError, WorkbenchError
from mbmodel.mjcf.difference import Difference, compare_compiled
from mbmodel.mjcf.edit import Addition, Edit, NotInMjcf, write_mjcf
from mbmodel.mjcf.read import compile_with_remarks

_Comparison = Callable[[Path], Difference | None]
_Changes = Sequence[Edit | Addition]


@dataclass(frozen=True)
class WrittenModel:
    """Outcome of writing a model: what its file lacks, and how it differs.

    Args:
        file: name of the file.
        not_held: what an MJCF cannot hold.
        difference: how the file differs in what it can hold; empty if it does not.
    """

    file: str
    not_held: tuple[NotInMjcf, ...] = ()
    difference: str = ""


NOT_WRITTEN = WrittenModel("")  # a model of which no file was wanted


def refuse_difference(file: str, difference: str) -> None:
    """Raise WorkbenchError if a written file is not the machine in memory.

    Args:
        file: name of the file.
        difference: how it differs; empty if it does not.
    """
    if difference:
        raise WorkbenchError(
            f"{file} is not the machine that was meant: {difference}; all results are kept, but do "
            "not use this file, and report the model"
        )


def write_copy(
    source: Path, target: Path, changes: _Changes = (), folder: Path | None = None
) -> WrittenModel:
    """Write a copy of an MJCF with nonlinear joints, read it back and compare what is compiled.

    Args:
        source: the MJCF.
        target: the new file; its folder exists.
        changes: edits of joints and added tendons.
        folder: folder to which the new file will move, which exists; None if it stays.

    Raises:
        InputError: the source cannot be read any more.
    """
    before, _ = compile_with_remarks(source, without_friction=True)
    difference = write_and_compare(source, target, changes, folder, compare_with(before, changes))
    return WrittenModel(target.name, (), "" if difference is None else str(difference))


def compare_with(before: mujoco.MjModel, changes: _Changes) -> _Comparison:
    """Return a comparison of a file with a compiled model that has the changes."""

    def compare(path: Path) -> Difference | None:
        after, _ = compile_with_remarks(path, without_friction=True)
        return compare_compiled(before, after, changes)

    return compare


def write_and_compare(
    source: Path, target: Path, changes: _Changes, folder: Path | None, compare: _Comparison
) -> Difference | None:
    """Write a file as its author wrote it, else in expanded form, until it is what was meant.

    Returns:
        How the file differs even in expanded form; None if it does not.
    """
    difference: Difference | None = None
    for expanded in (False, True):
        if refused := write_mjcf(source, target, changes, folder, expanded=expanded):
            difference = Difference(refused[0].reason, refused[0].name, 1.0)
            continue
        try:
            with in_place(target, folder) as path:
                difference = compare(path)
        except (InputError, ConvergenceError) as error:
            difference = Difference(f"file cannot be read ({error})", target.name, 1.0)
        if difference is None:
            break
    return difference


@contextmanager
def in_place(target: Path, folder: Path | None) -> Iterator[Path]:
    """Yield a written file where it will lie, so that the files that it names are found."""
    if folder is None or folder.resolve() == target.parent.resolve():
        yield target
        return
    copy = folder / f".{uuid4().hex}.xml"
    copy.write_bytes(target.read_bytes())
    try:
        yield copy
    finally:
        copy.unlink()
