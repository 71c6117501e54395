"""Variables of MATLAB, numpy and text files, whatever bytes the files hold.

MATLAB files of version 7.3, which are HDF5 files.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from identification.readers.child_process import read_in_child
from identification.readers.matlab5 import read_matlab5
from identification.readers.numpy_archive import read_archive
from identification.readers.result_files import check_format
from identification.readers.text_arrays import read_text_arrays
from identification.words import InputError
from identification.words.file_access import check_file

TEXT_SUFFIXES = (".csv", ".txt", ".dat", ".lvm")
# Version and order of bytes of MATLAB 7.3, at their place in the header before HDF5.
_HEADERS_OF_VERSION_73, _VERSION_PLACE = (b"\x00\x02IM", b"\x02\x00MI"), slice(124, 128)


def is_text(path: Path) -> bool:
    """Return whether a file is a table of text, by its suffix."""
    return path.suffix.lower() in TEXT_SUFFIXES


def load_arrays(
    path: Path, columns: Sequence[int | str] | None = None, forces: int = 1
) -> dict[str, np.ndarray]:
    """Read all variables of a .mat file (any version) or .npz file, or the columns of a text file.

    Every size that a file announces is checked before memory is allocated for it. HDF5 files are
    read in a process of their own.

    Args:
        columns: headings or numbers of the columns of a text file; None for all.
        forces: number of forces that act at once in time records of a text file.

    Raises:
        InputError: the file is missing or unreadable.
    """
    if is_text(path):
        return read_text_arrays(path, columns, forces)
    if columns is not None:
        raise InputError(f"{path} is no text file: remove columns from its [[test]]")
    check_file(path, "name the file of the test")
    version, read = "", read_archive
    try:
        if path.suffix.lower() == ".mat":
            read = read_matlab5
            if _is_version_73(path):
                version, read = "is MATLAB v7.3 and ", read_matlab73
        content = read(path)
        check_format(_stated_format(content.pop("format", None)), path)
    except InputError:  # of the folder for temporary files, or of a newer format
        raise
    except Exception as error:  # on corrupt bytes the readers raise errors of many types
        reason = " ".join(str(error).split()).replace("\0", "")
        raise InputError(
            f"{path} {version}cannot be read ({reason or type(error).__name__}): save it again"
        ) from error
    return {name: value for name, value in content.items() if name and not name.startswith("__")}


def _stated_format(value: object) -> object:
    """Return the format that an array file states; None if it states none."""
    number = np.asarray(value)
    return int(number.item()) if number.size == 1 and number.dtype.kind in "iuf" else None


def _is_version_73(path: Path) -> bool:
    """Return whether a file has the header of MATLAB 7.3."""
    with path.open("rb") as file:
        return file.read(_VERSION_PLACE.stop)[_VERSION_PLACE] in _HEADERS_OF_VERSION_73


_SCRIPT = Path(__file__).with_name("matlab73_child.py")


def read_matlab73(path: Path) -> dict[str, np.ndarray]:
    """Read the numeric variables by name, in a process of its own.

    Raises:
        ValueError: the file is damaged, or refers to other files.
    """
    return read_in_child(_SCRIPT, path)
