"""Append-only log of a session's actions, outside the folder of the campaign or model.

The first line holds the state at which the session began, each further line one action. Replaying
them gives the state again. A log belongs to the content of its input files: other content begins a
log of its own, and the earlier one stays.
"""

import hashlib
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import reduce
from pathlib import Path
from typing import TextIO

from pydantic import TypeAdapter, ValidationError

from identification.words import InputError
from mbw.workbench.state import Action, History, SessionState, apply

try:
    import fcntl
except ImportError:  # Windows has no such lock: two servers of one state are not told apart there
    fcntl = None  # type: ignore[assignment]

ACTION: TypeAdapter[Action] = TypeAdapter(Action)
_STATE = TypeAdapter(SessionState)


@dataclass(frozen=True, eq=False)
class StateLog:
    """Log that is open for appending.

    Args:
        path: its file.
        history: history that the log holds when it is opened.
        remark: what could not be read of it; empty if nothing.
        stream: the file, opened for appending.
    """

    path: Path
    history: History
    remark: str
    stream: TextIO

    def append(self, action: Action) -> None:
        """Write an action to the disk, whole or not at all.

        Raises:
            OSError: the disk takes nothing more.
        """
        number = self.stream.fileno()
        size = os.fstat(number).st_size
        content = ACTION.dump_json(action, exclude_none=True) + b"\n"
        try:
            while content:
                content = content[os.write(number, content) :]
        except OSError:
            os.ftruncate(number, size)
            raise


def log_path(source: Path, name: str, first: SessionState) -> Path:
    """Return the file of a log, in the user's folder for state.

    Args:
        source: campaign.toml, or file of the model.
        name: name of the state.
        first: state at which the session begins.

    Raises:
        InputError: the name cannot be that of a file.
    """
    if not re.fullmatch(r"[\w][\w .-]{0,60}", name):
        raise InputError(f"--state {name!r} cannot name a file: use letters, digits, - and _")
    content = hashlib.sha256(f"{first.campaign} {first.model}".encode()).hexdigest()[:8]
    return state_folder(source) / f"{name}-{content}.jsonl"


def state_folder(source: Path) -> Path:
    """Return the user's folder for the states of a campaign or model.

    Args:
        source: campaign.toml, or file of the model.
    """
    fallback = Path.home() / ("AppData/Local" if sys.platform == "win32" else ".local/state")
    home = Path(os.environ.get("XDG_STATE_HOME") or fallback)
    place = source.parent if source.suffix == ".toml" else source
    where = hashlib.sha256(os.fsencode(source.absolute())).hexdigest()[:8]
    return home / "mbw" / f"{place.stem}-{where}"


@contextmanager
def open_log(path: Path, first: SessionState) -> Iterator[StateLog]:
    """Read a log and hold it open for appending; begin it if it does not exist.

    Args:
        path: its file.
        first: state at which a new session begins.

    Raises:
        InputError: the file cannot be read or written, or another server uses it.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # A last line may be cut within a character.
        with path.open("a+", encoding="utf-8", errors="replace") as stream:
            _lock_log(stream, path)
            stream.seek(0)
            history, remark, good_bytes = _replay(stream.read(), path)
            if history is None:
                history = History(first)
                stream.truncate(0)  # a first line that was cut off
                stream.write(_STATE.dump_json(first).decode() + "\n")
                stream.flush()
            elif remark:
                stream.truncate(good_bytes)
            yield StateLog(path, history, remark, stream)
    except OSError as error:
        raise InputError(
            f"{path} cannot be read or written ({error.strerror}): set XDG_STATE_HOME to a folder "
            "that can"
        ) from error


def _replay(text: str, path: Path) -> tuple[History | None, str, int]:
    """Return the history of a log, a remark on a torn last line, and the bytes before that line."""
    *lines, torn = text.split("\n")  # names may hold other characters that end lines
    if not lines:
        return None, "", 0
    try:
        first = _STATE.validate_json(lines[0])
        actions = [ACTION.validate_json(line) for line in lines[1:]]
    except ValidationError as error:
        raise InputError(
            f"{path} is no log of this version of mbw open: name another state with --state"
        ) from error
    remark = f"the last action of {path} was cut off and is left out" if torn else ""
    size = len(text[: len(text) - len(torn)].encode())
    return reduce(apply, actions, History(first)), remark, size


def _lock_log(stream: TextIO, path: Path) -> None:
    """Refuse a log that another server holds."""
    if fcntl is None:
        return
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise InputError(
            f"another mbw open uses the state {path.stem}: use its page, or name another state "
            "with --state"
        ) from error
