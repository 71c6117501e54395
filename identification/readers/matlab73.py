"""MATLAB files of version 7.3, which are HDF5 files."""

from pathlib import Path

import numpy as np

from identification.readers.child_process import read_in_child

_SCRIPT = Path(__file__).with_name("matlab73_child.py")


def read_matlab73(path: Path) -> dict[str, np.ndarray]:
    """Read the numeric variables by name, in a process of its own.

    Raises:
        ValueError: the file is damaged, or refers to other files.
    """
    return read_in_child(_SCRIPT, path)
