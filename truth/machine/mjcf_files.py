"""The files that an MJCF reads, so that a campaign can hold copies of all of them."""

import os
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path

from truth.errors import TruthError

_COMPILER_FOLDERS = ("", "meshdir", "texturedir", "assetdir")


def gather_files(path: Path) -> tuple[Mapping[str, bytes], str]:
    """Return the content of an MJCF and of all files that it reads.

    Returns:
        Content by path within their common folder, and the main file's path there.

    Raises:
        TruthError: a file cannot be read.
    """
    main = path.absolute()
    files: dict[Path, bytes] = {}
    waiting = [main]
    while waiting:
        file = Path(os.path.normpath(waiting.pop()))
        if file in files:
            continue
        files[file] = _content(file)
        if file.suffix.lower() in (".xml", ".mjcf") or file == main:
            waiting += _list_named_files(file, files[file], main.parent)
    common = Path(os.path.commonpath([file.parent for file in files]))
    contents = {file.relative_to(common).as_posix(): content for file, content in files.items()}
    return contents, Path(os.path.normpath(main)).relative_to(common).as_posix()


def _content(file: Path) -> bytes:
    if file.exists() and not file.is_file():  # a pipe or device could be without an end
        raise TruthError(f"{file}: is no file; give an MJCF file")
    try:
        return file.read_bytes()
    except OSError as error:
        raise TruthError(f"{file}: cannot be read ({error.strerror}); give its file") from error


def _list_named_files(file: Path, content: bytes, folder: Path) -> list[Path]:
    """Return the files that a text names, in any of the folders that it states."""
    try:
        root = ET.fromstring(content)
    except ET.ParseError as error:
        raise TruthError(f"{file}: is not XML ({error}); give an MJCF file") from error
    folders = {folder, file.parent}
    for compiler in root.iter("compiler"):
        folders |= {folder / compiler.get(name, "") for name in _COMPILER_FOLDERS}
    names = {
        value
        for element in root.iter()
        for key, value in element.attrib.items()
        if key.startswith("file")
    }
    places = [place / name for name in names for place in folders]
    return [place for place in places if place.is_file()]
