"""Reading of a foreign file in a process of its own, with limits of time and memory.

Libraries in C may crash or hang on a damaged file. In a child process that costs one message.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

from identification.readers.inflation import max_inflated_bytes
from identification.readers.numpy_archive import read_archive
from identification.words.file_access import no_temporary_space, temporary_folder

_CANNOT_WRITE = 2  # exit code of the child: its result cannot be written
_MAIN = Path(__file__).with_name("child_main.py")
# A healthy file needs a hundredth of this time.
_MIN_CPU_SECONDS, _BYTES_PER_CPU_SECOND = 10, 1 << 20
_WALL_PER_CPU_TIME = 10  # other programs may occupy the processor
_MIN_MEMORY_BYTES, _COPIES_IN_MEMORY = 4 << 30, 4  # address space: libraries, and some copies


def read_in_child(script: Path, path: Path) -> dict[str, np.ndarray]:
    """Read a file by a script in a child process and return its arrays by name.

    Args:
        script: Python file with a function ``read(path, max_array_bytes)`` that returns the arrays.
            It imports no module of this project, so that the process starts quickly.
        path: the file to read.

    Raises:
        ValueError: the script refuses the file, crashes on it, or exceeds a limit.
        InputError: the folder for temporary files cannot be written.
    """
    size = path.stat().st_size
    seconds = _MIN_CPU_SECONDS + size // _BYTES_PER_CPU_SECOND
    max_array_bytes = max_inflated_bytes(size)
    memory = _MIN_MEMORY_BYTES + _COPIES_IN_MEMORY * max_array_bytes
    with temporary_folder() as folder:
        result = folder / "arrays.npz"
        command = [_MAIN, script, path.resolve(), max_array_bytes, result, seconds, memory]
        try:
            child = subprocess.run(
                [sys.executable, "-P", *map(str, command)],
                stdin=subprocess.DEVNULL,
                capture_output=True,
                timeout=_WALL_PER_CPU_TIME * seconds,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise ValueError("reading it does not end") from None
        answer = child.stdout.decode("utf-8", "replace")
        if child.returncode == _CANNOT_WRITE:
            raise no_temporary_space(OSError(answer.strip()))
        if child.returncode:
            raise ValueError(answer.strip() or "reading it crashed, or did not end")
        arrays = read_archive(result)
        return {name: arrays[f"arr_{k}"] for k, name in enumerate(json.loads(answer))}
