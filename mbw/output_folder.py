"""Folder of a result: chosen, checked before the work, locked during it, and never another's.

A record in the folder says which verb and which campaign or model made each file. The results of
one campaign replace each other; files of another one stay unless the user states ``--overwrite``.
"""

import json
import os
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from identification.words import InputError
from identification.words.file_access import real_path
from mbw.messages import SCREEN
from tuning import write_atomically

try:
    import fcntl
except ImportError:  # Windows has no such lock: two runs into one folder are not told apart there
    fcntl = None  # type: ignore[assignment]

RECORD = ".mbw.json"
Record = dict[str, dict[str, str]]  # verb and source by file name


@dataclass(frozen=True)
class OutputRequest:
    """Where a verb shall write its result.

    Args:
        verb: name of the verb.
        source: campaign.toml, or file of the model, from which the result is made.
        folder: folder of the result.
        names: file names that a result of this verb can have.
        overwrite: whether files of another campaign or model may be replaced.
        adopts: whether files without a record count as made from this source.
    """

    verb: str
    source: Path
    folder: Path
    names: tuple[str, ...]
    overwrite: bool = False
    adopts: bool = False


@dataclass(frozen=True)
class OutputFolder:
    """Folder of a result while it is locked for one run.

    Args:
        path: the folder.
        request: what the verb asked for.
    """

    path: Path
    request: OutputRequest

    @contextmanager
    def write(self) -> Iterator[Path]:
        """Yield a temporary folder whose files become the result, and record who made them.

        Files of an earlier result of this verb that are not written again are removed, so that no
        page shows other numbers than the files beside it.
        """
        request, record = self.request, _read_record(self.path)
        with write_atomically(self.path) as place:
            yield place
            written = {file.name for file in place.iterdir()}
            outdated = {name for name in request.names if name not in written}
            outdated -= {name for name in outdated if _is_of_another_verb(record, request, name)}
            entry = {"verb": request.verb, "source": _relative(request.source, self.path)}
            kept = {name: row for name, row in record.items() if name not in outdated}
            text = json.dumps({**kept, **dict.fromkeys(sorted(written), entry)}, indent=1)
            (place / RECORD).write_text(text + "\n", encoding="utf-8")
        for name in outdated:
            (self.path / name).unlink(missing_ok=True)


@dataclass(frozen=True)
class ResultOptions:
    """Values of the options that say where a verb writes its result.

    Args:
        out: folder of the result; None for the default.
        json: further JSON file, or ``-`` for stdout; None for none.
        overwrite: whether files of another campaign or model may be replaced.
        pictures: whether the page is written.
    """

    out: Path | None = None
    json: Path | None = None
    overwrite: bool = False
    pictures: bool = True

    @property
    def has_json_on_stdout(self) -> bool:
        """Whether stdout holds the JSON and nothing else."""
        return str(self.json) == "-"

    @property
    def has_tables(self) -> bool:
        """Whether tables go to stdout: it holds no JSON, and the verb is not quiet."""
        return not (self.has_json_on_stdout or SCREEN.quiet)

    def say_page(self, page: Path) -> None:
        """Say where the page is, if one is written."""
        if self.pictures:
            SCREEN.say(f"pictures in {page.absolute().as_uri()}")

    @contextmanager
    def open(
        self, verb: str, source: Path, suffix: str, names: Iterable[str]
    ) -> Iterator[OutputFolder]:
        """Check the targets, and lock the folder of the result while the verb works.

        Args:
            verb: name of the verb.
            source: campaign.toml, or file of the model.
            suffix: end of the default folder's name.
            names: file names that a result of this verb can have.

        Raises:
            InputError: a target cannot be written, or belongs to another campaign or model.
        """
        folder = self.out or default_folder(source, suffix)
        is_beside = folder.absolute() == folder_beside(source, suffix)
        request = OutputRequest(
            verb, source, folder, tuple(names), self.overwrite, adopts=is_beside
        )
        with open_output_folder(request) as output:
            yield output


@contextmanager
def open_output_folder(request: OutputRequest) -> Iterator[OutputFolder]:
    """Check and lock the folder of a result; leave no empty folder behind.

    Raises:
        InputError: the folder cannot be written, another run uses it, or it holds files of another
            campaign or model.
    """
    folder = request.folder
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        with write_atomically(folder) as place:  # creates the folder, or says why it cannot
            (place / ".probe").touch()
            (place / ".probe").unlink()
        with _lock(folder):
            _check_files(request)
            yield OutputFolder(folder, request)
    finally:
        with suppress(OSError):  # a folder that holds a result is not empty and stays
            for path in missing:
                path.rmdir()


_STEMS: ContextVar[Mapping[Path, Path]] = ContextVar("stems", default=MappingProxyType({}))


@contextmanager
def results_beside(stems: Mapping[Path, Path]) -> Iterator[None]:
    """Let results of some campaigns and models lie beside other paths.

    Args:
        stems: these paths, by the absolute path of the campaign's folder or of the model; of a
            folder of results, where its page goes.
    """
    token = _STEMS.set(stems)
    try:
        yield
    finally:
        _STEMS.reset(token)


def page_folder(result: Path) -> Path:
    """Return the folder into which the page of a result goes: its own, unless it is built in."""
    folder = result if result.is_dir() else result.parent
    return _STEMS.get().get(Path(os.path.abspath(folder)), folder)


def folder_beside(source: Path, suffix: str) -> Path:
    """Return the folder beside a campaign or model and named after it, such as ``test1-tuned``.

    Args:
        source: campaign.toml of a campaign, or file of a model.
        suffix: what the verb does, such as ``tuned``.
    """
    path = Path(os.path.abspath(source))
    path = path.parent if path.suffix == ".toml" else path
    path = _STEMS.get().get(path, path)
    return path.with_name(f"{path.name if path.is_dir() else path.stem}-{suffix}")


def default_folder(source: Path, suffix: str) -> Path:
    """Return the folder beside a source; say so where only the current folder can be written."""
    folder = folder_beside(source, suffix)
    if not _can_write(folder):
        unusable, folder = folder.parent, Path.cwd() / folder.name
        SCREEN.say(f"{unusable} cannot be written: the results go to {folder}")
    return folder.relative_to(Path.cwd()) if folder.is_relative_to(Path.cwd()) else folder


def source_of(folder: Path, name: str) -> Path | None:
    """Return the campaign or model from which a file of a result was made; None if unknown."""
    row = _read_record(folder).get(name)
    return None if row is None else _resolve(row, folder)


def _check_files(request: OutputRequest) -> None:
    """Refuse files that the result would replace and that another campaign or nobody made."""
    record, folder = _read_record(request.folder), request.folder
    for name in request.names:
        path, row = folder / name, record.get(name)
        if path.is_dir():
            raise InputError(
                f"{path} is a folder, but the result has a file of that name: name another output "
                "folder with --out"
            )
        if not path.exists() or request.overwrite:
            continue
        if row is None and request.adopts:
            continue
        if row is None:
            raise InputError(
                f"{path} exists and is no result of this campaign or model: name another folder "
                "with --out, or replace it with --overwrite"
            )
        owner = _resolve(row, folder)
        if owner != real_path(request.source):
            raise InputError(
                f"{path} was made from {owner}, not from {request.source}: name another folder "
                "with --out, or replace it with --overwrite"
            )
        if _is_of_another_verb(record, request, name):
            SCREEN.say(f"{path} of mbw {row['verb']} will be replaced")


def _is_of_another_verb(record: Record, request: OutputRequest, name: str) -> bool:
    """Return whether another verb made a file from the same campaign or model."""
    row = record.get(name)
    if row is None or row["verb"] == request.verb:
        return False
    return _resolve(row, request.folder) == real_path(request.source)


@contextmanager
def _lock(folder: Path) -> Iterator[None]:
    """Hold an advisory lock on a folder; it ends with the process, however that ends.

    Raises:
        InputError: another run holds it.
    """
    if fcntl is None:
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise InputError(
                f"another run of mbw writes into {folder}: wait for its end, or name another "
                "folder with --out"
            ) from error
        except OSError:  # a file system without locks: nothing is known of other runs
            pass
        yield
    finally:
        os.close(handle)


def _read_record(folder: Path) -> Record:
    """Return who made the files of a folder; empty where no record can be read."""
    try:
        rows = json.loads((folder / RECORD).read_text("utf-8"))
        return {
            str(name): {"verb": str(row["verb"]), "source": str(row["source"])}
            for name, row in rows.items()
        }
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return {}


def _relative(source: Path, folder: Path) -> str:
    """Return the path from a folder to a source: both can move together."""
    try:
        return os.path.relpath(real_path(source), real_path(folder))
    except ValueError:  # two drives of Windows
        return str(real_path(source))


def _resolve(row: dict[str, str], folder: Path) -> Path:
    return Path(os.path.normpath(real_path(folder) / row["source"]))


def _can_write(folder: Path) -> bool:
    """Return whether a folder, or the nearest one above it that exists, may be written.

    A folder that nobody may write by its mode is left alone by the superuser too.
    """
    nearest = next(path for path in (folder, *folder.parents) if path.exists())
    is_protected = not nearest.stat().st_mode & (stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH)
    return not is_protected and os.access(nearest, os.W_OK | os.X_OK)
