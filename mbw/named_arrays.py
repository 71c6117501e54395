"""Arrays with names in a file: .npz for Python, .mat for MATLAB."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import scipy.io

from identification.readers.result_files import write_result_arrays
from identification.words import InputError


def write_named_arrays(
    target: Path, arrays: Mapping[str, np.ndarray], texts: Mapping[str, Sequence[str] | str]
) -> None:
    """Write arrays and texts; lists of texts are cell arrays in MATLAB.

    Args:
        target: .npz or .mat.
        arrays: by name.
        texts: a text, or a list of texts, by name.

    Raises:
        InputError: the file cannot be written.
    """
    try:
        if target.suffix == ".mat":
            cells = {
                key: value if isinstance(value, str) else np.array(list(value), object)
                for key, value in texts.items()
            }
            scipy.io.savemat(target, {**arrays, **cells})
        else:
            words = {key: np.array(value) for key, value in texts.items()}
            write_result_arrays(target, {**arrays, **words})
    except OSError as error:
        raise InputError(f"{target} cannot be written ({error.strerror}): name another") from error
