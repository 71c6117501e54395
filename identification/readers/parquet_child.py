"""Script for a child process that reads the numeric columns of a Parquet file by pyarrow."""

from pathlib import Path

import numpy as np
import pyarrow.types
from pyarrow.parquet import ParquetFile


def read(path: Path, max_array_bytes: int) -> dict[str, np.ndarray]:
    """Read the numeric columns by name; a missing value is NaN.

    Args:
        path: the file.
        max_array_bytes: bytes that all columns together may take in memory.

    Raises:
        ValueError: the file announces more bytes.
        OSError: the file is damaged.
    """
    with ParquetFile(path) as file:
        names = [
            field.name
            for field in file.schema_arrow
            if pyarrow.types.is_integer(field.type) or pyarrow.types.is_floating(field.type)
        ]
        size = 8 * len(names) * file.metadata.num_rows
        if size > max_array_bytes:
            raise ValueError(f"it announces {size} bytes of columns, far more than it can hold")
        table = file.read(names)
        return {name: table[name].to_numpy().astype(float) for name in names}
