"""Script for a child process that reads HDF5, such as a MATLAB file of version 7.3, by h5py.

Only bytes of the file itself are read: links to other files, external storage and virtual datasets
are refused.
"""

from pathlib import Path

import h5py
import numpy as np

_COMPLEX_FIELDS = ("real", "imag")


def read(path: Path, max_array_bytes: int) -> dict[str, np.ndarray]:
    """Read the numeric variables by name, with the order of axes of MATLAB.

    HDF5 stores the axes in reversed order, and complex numbers as pairs named real and imag. What
    lies in a group has its name before, as in ``log/current``.

    Args:
        max_array_bytes: bytes that all variables together may take in memory.

    Raises:
        ValueError: the file refers to another file, or announces more bytes.
        OSError: the file is not HDF5, or it is damaged.
    """
    with h5py.File(path, "r") as file:
        _refuse_links(file)
        datasets: dict[str, h5py.Dataset] = {}

        def collect(name: str, item: h5py.Dataset | h5py.Group) -> None:
            is_cell = name.startswith("#")  # of MATLAB, which only references name
            if is_cell or not isinstance(item, h5py.Dataset) or item.size is None:
                return
            if _is_numeric(item.dtype):
                datasets[name] = item

        file.visititems(collect)
        for name, item in datasets.items():
            if item.external or item.is_virtual:
                raise ValueError(f"{name} takes its values from another file")
        size = sum(item.size * item.dtype.itemsize for item in datasets.values())
        if size > max_array_bytes:
            raise ValueError(f"it announces {size} bytes of arrays, far more than it can hold")
        return {name: _read_values(item) for name, item in datasets.items()}


def _refuse_links(file: h5py.File) -> None:
    """Refuse a file with a link that is no plain name of an object of the file."""
    names: list[str] = []

    def collect(name: bytes, link: h5py.h5l.LinkInfo) -> None:
        if link.type != h5py.h5l.TYPE_HARD:
            names.append(name.decode(errors="replace"))

    file.id.links.visit(collect, info=True)
    if names:
        raise ValueError(f"{names[0]} is a link, which may leave the file")


def _is_numeric(kind: np.dtype) -> bool:
    """Return whether values are real numbers, or pairs of them that are complex numbers."""
    parts = [kind[name] for name in _COMPLEX_FIELDS] if kind.names == _COMPLEX_FIELDS else [kind]
    return all(part.kind in "fiuc" and not part.shape for part in parts)


def _read_values(item: h5py.Dataset) -> np.ndarray:
    """Return the values of a dataset."""
    values = np.asarray(item[()])
    if values.dtype.names:
        pairs = values
        values = np.empty(pairs.shape, complex)
        values.real, values.imag = pairs["real"], pairs["imag"]
    return values.T
