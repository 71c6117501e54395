"""Script for a child process that reads the numeric columns of a Parquet file by pyarrow."""

from pathlib import Path

import numpy as np
import pyarrow.types
from pyarrow.parquet import ParquetFile

_CLOCKS = ("time", "t")  # count from the first: doubles hold no epoch in ns


def read(path: Path, max_array_bytes: int) -> dict[str, np.ndarray]:
    """Read the numeric columns by name; a missing value is NaN, stamps count from the first [s].

    Args:
        max_array_bytes: bytes that all columns together may take in memory.

    Raises:
        ValueError: the file announces more bytes.
        OSError: the file is damaged.
    """
    with ParquetFile(path) as file:
        kinds = {field.name: field.type for field in file.schema_arrow}
        stamps = {name for name, kind in kinds.items() if pyarrow.types.is_timestamp(kind)}
        names = [
            name
            for name, kind in kinds.items()
            if name in stamps or pyarrow.types.is_integer(kind) or pyarrow.types.is_floating(kind)
        ]
        size = 8 * len(names) * file.metadata.num_rows
        if size > max_array_bytes:
            raise ValueError(f"it announces {size} bytes of columns, far more than it can hold")
        table = file.read(names)
        arrays = {name: table[name].to_numpy() for name in names}
    return {
        name: (values - values[0]) / np.timedelta64(1, "s")
        if name in stamps
        else (values - values[0] if name.lower().split(" ")[0] in _CLOCKS else values).astype(float)
        for name, values in arrays.items()
    }
