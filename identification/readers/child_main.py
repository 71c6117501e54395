"""Program of the child process that reads one foreign file by a script.

It sets its own limits, calls ``read(path, max_array_bytes)`` of the script and saves the arrays.
Its output is a list of their names, or the reason why the file cannot be read.
"""

import contextlib
import errno
import json
import os
import runpy
import sys
from pathlib import Path

import numpy as np

try:
    import resource
except ImportError:  # Windows, where only the parent limits the time
    resource = None  # type: ignore[assignment]


def main(script: str, path: str, max_array_bytes: str, result: str, *limits: str) -> int:
    """Read a file and save its arrays; return the exit code.

    Args:
        script: Python file with the function ``read``.
        path: the file to read.
        max_array_bytes: bytes that its arrays may take in memory.
        result: file for the arrays.
        limits: processor time [s] and address space [byte] of this process.
    """
    _limit(*map(int, limits))
    answer = os.dup(1)
    with open(os.devnull, "w") as nowhere:  # libraries print
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
    try:
        arrays = runpy.run_path(script)["read"](Path(path), int(max_array_bytes))
    except (SystemExit, Exception) as error:
        is_text = isinstance(error, Exception)  # the reason of SystemExit is a number
        reason = (" ".join(str(error).split()) if is_text else "") or type(error).__name__
        os.write(answer, reason.encode("utf-8", "replace"))
        return 1
    try:
        np.savez(result, *arrays.values())
    except OSError as error:
        # numpy tells a full disk by a count of bytes alone.
        os.write(answer, os.strerror(error.errno or errno.ENOSPC).encode())
        return 2
    os.write(answer, json.dumps(list(arrays)).encode())
    return 0


def _limit(seconds: int, memory_bytes: int) -> None:
    """Limit processor time and address space of this process, and write no image of a crash."""
    if resource is None:
        return
    limits = (
        (resource.RLIMIT_CPU, seconds),
        (resource.RLIMIT_AS, memory_bytes),
        (resource.RLIMIT_CORE, 0),
    )
    for kind, limit in limits:
        with contextlib.suppress(ValueError, OSError):  # a lower limit is set already
            resource.setrlimit(kind, (limit, limit))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
