"""MATLAB files of version 7.3, which are HDF5 files."""

from pathlib import Path

import h5py
import numpy as np

_COMPLEX_FIELDS = ("real", "imag")


def read_matlab73(path: Path) -> dict[str, np.ndarray]:
    """Read the numeric variables by name, with the order of axes of MATLAB.

    HDF5 stores the axes in reversed order, and complex numbers as pairs named real and imag.

    Raises:
        OSError: the file is not HDF5, or it is damaged.
    """
    variables = {}
    with h5py.File(path, "r") as file:
        for name, item in file.items():
            if isinstance(item, h5py.Dataset):
                values = item[()]
                if (
                    getattr(values, "dtype", None) is not None
                    and values.dtype.names == _COMPLEX_FIELDS
                ):
                    values = values["real"] + 1j * values["imag"]
                if isinstance(values, np.ndarray) and values.dtype.kind in "fiuc":
                    variables[name] = values.T
    return variables
