"""MATLAB files of version 7.3, which are HDF5: the one place that reads that format."""

from pathlib import Path

import h5py
import numpy as np

_COMPLEX = ("real", "imag")


def read_matlab73(path: Path) -> dict[str, np.ndarray]:
    """Numeric variables by name, with MATLAB's order of axes.

    HDF5 holds them with the axes reversed, and complex numbers as pairs named real and imag.

    Raises:
        OSError: the file is no HDF5, or broken.
    """
    found = {}
    with h5py.File(path, "r") as file:
        for name, item in file.items():
            if isinstance(item, h5py.Dataset):
                values = item[()]
                if getattr(values, "dtype", None) is not None and values.dtype.names == _COMPLEX:
                    values = values["real"] + 1j * values["imag"]
                if isinstance(values, np.ndarray) and values.dtype.kind in "fiuc":
                    found[name] = values.T
    return found
