"""Files of a folder that appear or change while a test runs, found by polling.

Network folders send no events, and clocks of two computers differ. So a file counts when its size
and time of change have stayed for half a second of this computer's clock, and it can be read. A
file that cannot be read may be half written: it is tried again until it can be.
"""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, TypeVar

from identification.words import InputError

REST_S = 0.5
_RETRY_S = 1.0  # after which a file that could not be read is tried again
_SILENT_S = 1.0  # for which one that rests may be half written, before a sentence says so
Content = TypeVar("Content")


@dataclass
class _Seen:
    """A file as it was seen last.

    Attributes:
        stamp: size and time of change.
        since: when it was seen first with this stamp [s].
        tried: when it was last tried to read; None before.
        is_read: whether it was read with this stamp.
    """

    stamp: tuple[int, int]
    since: float
    tried: float | None = None
    is_read: bool = False


@dataclass(frozen=True, eq=False)
class Changes(Generic[Content]):
    """Result of a look at the folder.

    Args:
        read: files that were read, new or anew, by the time of their change.
        gone: files that are no longer there.
        failures: sentences on files that rest and cannot be read, or that no pattern names.
    """

    read: tuple[tuple[Path, Content], ...] = ()
    gone: tuple[Path, ...] = ()
    failures: tuple[str, ...] = ()


@dataclass(eq=False)
class FolderWatch(Generic[Content]):
    """Watch of the files of some patterns.

    Args:
        folder: the folder; it need not exist at all times.
        patterns: names of files, with ``*`` and ``?``.
        read: function that reads a file, and raises InputError if it cannot.
        clock: returns the time [s].
    """

    folder: Path
    patterns: Sequence[str]
    read: Callable[[Path], Content]
    clock: Callable[[], float] = time.monotonic
    _seen: dict[Path, _Seen] = field(default_factory=dict)
    _said: set[str] = field(default_factory=set)
    _beside: set[str] | None = None

    def poll(self) -> Changes[Content]:
        """Look at the folder, and read what is new and rests."""
        now = self.clock()
        try:
            stamps, beside = dict(self._list()), self._files_beside()
        except OSError:  # a network folder that is away for a moment
            return Changes()
        gone = tuple(path for path in self._seen if path not in stamps)
        was_read = tuple(path for path in gone if self._seen[path].is_read)
        for path in gone:
            del self._seen[path]
        contents: list[tuple[Path, Content]] = []
        named = ", ".join(self.patterns)
        failures = [f"{name} is not counted: the test names {named}" for name in beside]
        for path, stamp in sorted(stamps.items(), key=lambda item: (item[1][1], item[0])):
            seen = self._seen.get(path)
            if seen is None or seen.stamp != stamp:
                self._seen[path] = _Seen(stamp, now)
                continue
            if seen.is_read or now - seen.since < REST_S:
                continue
            if seen.tried is not None and now - seen.tried < _RETRY_S:
                continue
            seen.tried = now
            try:
                contents.append((path, self.read(path)))
                seen.is_read = True
            except (InputError, OSError) as error:
                sentence = f"{path.name} is not counted: {error}"
                if now - seen.since > _SILENT_S and sentence not in self._said:
                    self._said.add(sentence)
                    failures.append(sentence)
        return Changes(tuple(contents), was_read, tuple(failures))

    def _files_beside(self) -> list[str]:
        """Return the files that appeared since the last look and that no pattern names."""
        names = {path.name for path in self.folder.iterdir() if path.is_file()}
        before, self._beside = self._beside, names
        return sorted(
            name
            for name in names - (names if before is None else before)
            if not name.startswith((".", "~")) and not any(map(Path(name).match, self.patterns))
        )

    def _list(self) -> Iterable[tuple[Path, tuple[int, int]]]:
        """Yield the files that match, with size and time of change."""
        next(self.folder.iterdir(), None)  # tells a folder that is away from an empty one
        for pattern in self.patterns:
            for path in self.folder.glob(pattern):
                try:
                    status = path.stat()
                except FileNotFoundError:
                    continue
                if path.is_file():
                    yield path, (status.st_size, status.st_mtime_ns)
