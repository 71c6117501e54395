"""Archives of numpy arrays (.npz), whose arrays are checked before they are allocated."""

import math
import zipfile
from pathlib import Path

import numpy as np
from numpy.lib import format as npy_format

from identification.readers.inflation import refuse_inflation

_SUFFIX = ".npy"


def read_archive(path: Path) -> dict[str, np.ndarray]:
    """Read the arrays of an archive by name; arrays of Python objects are refused.

    Raises:
        ValueError: an array is of objects, or larger than its bytes in the archive.
        zipfile.BadZipFile: the file is no archive, or it is damaged.
    """
    with zipfile.ZipFile(path) as archive:
        entries = [entry for entry in archive.infolist() if entry.filename.endswith(_SUFFIX)]
        refuse_inflation(sum(entry.file_size for entry in entries), path.stat().st_size)
        return {
            entry.filename.removesuffix(_SUFFIX): _read_array(archive, entry) for entry in entries
        }


def _read_array(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> np.ndarray:
    """Read one array, whose header must agree with the number of its bytes."""
    name = entry.filename.removesuffix(_SUFFIX)
    with archive.open(entry) as file:
        version = npy_format.read_magic(file)
        read_header = (
            npy_format.read_array_header_1_0
            if version == (1, 0)
            else npy_format.read_array_header_2_0
        )
        shape, is_fortran, kind = read_header(file)
        if kind.hasobject:
            raise ValueError(f"{name} holds Python objects, which are not loaded")
        data = bytearray(file.read())
    if (
        not kind.itemsize
        or min(shape, default=0) < 0
        or math.prod(shape) * kind.itemsize != len(data)
    ):
        raise ValueError(f"{name} of {len(data)} bytes does not fit the dimensions {shape}")
    return np.frombuffer(data, kind).reshape(shape, order="F" if is_fortran else "C")
