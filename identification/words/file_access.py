"""Reading and writing of whole files: whatever cannot be done becomes one sentence.

A name in a campaign.toml or on the command line may be anything: a folder, a device that never
ends, a pipe that nobody writes, a link in a loop, or a text with a NUL character.
"""

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir

from identification.words.errors import InputError

_FULL = (errno.ENOSPC, errno.EDQUOT)  # of a disk, and of the user's share of it
_MAX_NAME_CHARACTERS = 60  # of a temporary file's name: file systems allow 255 bytes


def real_path(path: Path) -> Path:
    """Return an absolute path without links; one in a loop of links stays as it is.

    ``Path.resolve`` of some versions of Python raises RuntimeError there.
    """
    return Path(os.path.realpath(path))


def check_file(path: Path, remedy: str) -> None:
    """Refuse a path that is no regular file.

    Args:
        path: the path, of which links are followed.
        remedy: what to do about a file that is missing, for the message.

    Raises:
        InputError: nothing is there, or a folder, a device or a pipe.
    """
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError) as error:
        raise InputError(f"{path} does not exist: {remedy}") from error
    except (OSError, ValueError) as error:  # ValueError: a NUL character
        raise InputError(f"{path} cannot be read ({describe_reason(error)}): {remedy}") from error
    if not stat.S_ISREG(mode):
        kind = "a folder" if stat.S_ISDIR(mode) else "a device or a pipe"
        raise InputError(f"{path} is {kind}, a file of this name does not exist: {remedy}")


def read_bytes(path: Path, remedy: str) -> bytes:
    """Return the content of a regular file.

    Args:
        remedy: what to do about a file that is missing, for the message.

    Raises:
        InputError: the file is missing, is no regular file, or may not be read.
    """
    check_file(path, remedy)
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read ({describe_reason(error)}): {remedy}") from error


def read_text(path: Path, remedy: str) -> str:
    """Return the content of a text file in UTF-8, without a byte-order mark.

    Args:
        remedy: what to do about a file that is missing, for the message.

    Raises:
        InputError: the file is missing, is no regular file, may not be read, or is not UTF-8.
    """
    content = read_bytes(path, remedy)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(
            f"{path} cannot be read as text: line {line} is not UTF-8 text, so save it with this "
            "encoding"
        ) from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all; a file of that name is replaced.

    Devices and pipes are written as they are: they cannot be replaced.

    Args:
        path: the file, in a folder that exists.
        text: its content.

    Raises:
        InputError: the file cannot be written, for example because the disk is full.
    """
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file whole or not at all, as ``write_text`` does.

    Args:
        path: the file, in a folder that exists.
        content: its content.

    Raises:
        InputError: the file cannot be written, for example because the disk is full.
    """
    try:
        target = real_path(path)
        if target.exists() and not target.is_file():
            target.write_bytes(content)
            return
        new = target.with_name(f".{target.name[:_MAX_NAME_CHARACTERS]}.{os.getpid()}.new")
        try:
            with new.open("wb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            new.replace(target)
        finally:
            new.unlink(missing_ok=True)
    except (OSError, ValueError) as error:
        raise InputError(
            f"{path} cannot be written ({describe_reason(error)}): name another"
        ) from error


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Yield a folder that exists for a block; a full or missing disk for it is named as such.

    Raises:
        InputError: the folder for temporary files cannot be written.
    """
    try:
        opened = TemporaryDirectory()
    except OSError as error:
        raise no_temporary_space(error) from error
    with opened as name:
        try:
            yield Path(name)
        except (OSError, InputError) as error:
            cause = error if isinstance(error, OSError) else error.__cause__
            if isinstance(cause, OSError) and cause.errno in _FULL and name in f"{error}":
                raise no_temporary_space(cause) from error
            raise


def no_temporary_space(error: OSError) -> InputError:
    """Return the error of a folder for temporary files that cannot be written."""
    folder = os.environ.get("TMPDIR") or gettempdir()
    return InputError(
        f"the folder for temporary files, {folder}, cannot be written ({describe_reason(error)}): "
        "free space on its disk, or set TMPDIR to another folder"
    )


def describe_reason(error: OSError | ValueError) -> str:
    """Return the reason of the operating system in its words."""
    if isinstance(error, OSError) and error.errno is not None:
        return os.strerror(error.errno)
    return str(error)
