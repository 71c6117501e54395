"""Checkpoint of a tuning: finished steps in a file, from which an aborted tuning resumes.

A step (a stage of a start, or a fold) begins where the one before it ended and counts evaluations,
never time. Resumed tunings therefore give bit-identical results. Numbers are written so that they
read back exactly. A checksum over the whole content tells whether a file was altered.
"""

import hashlib
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from identification.words import InputError
from identification.words.file_access import read_bytes, write_text
from tuning.solvers.nlopt_solver import Minimum

CHECKPOINT_FILE = "tune.checkpoint.json"
_CHECKSUM = "sha256"  # key of the checksum over all other keys


class Checkpoint:
    """Finished steps by name.

    Args:
        file: file that keeps them; None keeps them in memory only.
        fingerprint: fingerprint of inputs and options; a file with another one is refused.
        resume: whether to read the file; otherwise it is replaced.

    Raises:
        InputError: a file to resume that cannot be read, that was altered, or that belongs to
            another tuning.
    """

    def __init__(
        self, file: Path | None = None, fingerprint: str = "", *, resume: bool = False
    ) -> None:
        self._file, self._fingerprint = file, fingerprint
        self._steps: dict[str, dict[str, Any]] = {}
        if resume and file is not None and os.path.lexists(file):
            self._steps = _read(file, fingerprint)

    def __len__(self) -> int:
        """Return the number of finished steps."""
        return len(self._steps)

    def recall(self, step: str) -> Minimum | None:
        """Return a finished step, or None."""
        record = self._steps.get(step)
        if record is None:
            return None
        return Minimum(**{**record, "x": np.array(record["x"])})

    def keep(self, step: str, end: Minimum) -> None:
        """Write a finished step, whole or not at all; an interrupted step is not finished."""
        if end.outcome == "interrupted":
            return
        self._steps[step] = {
            "x": end.x.tolist(),
            "value": float(end.value),
            "evaluations": end.evaluations,
            "outcome": end.outcome,
            "advice": end.advice,
        }
        if self._file is not None:
            content = {"fingerprint": self._fingerprint, "steps": self._steps}
            text = json.dumps({**content, _CHECKSUM: _checksum(content)})
            write_text(self._file, text)

    def run_step(self, name: str, make: Callable[[], Minimum]) -> Minimum:
        """Return a finished step, or make it now and keep it."""
        end = self.recall(name)
        if end is None:
            end = make()
            self.keep(name, end)
        return end

    def close(self) -> None:
        """Remove the file and its steps once the results are written."""
        self._steps = {}
        if self._file is not None:
            self._file.unlink(missing_ok=True)


def _read(file: Path, fingerprint: str) -> dict[str, dict[str, Any]]:
    """Read the finished steps of a file; refuse another fingerprint and altered content."""
    remedy = "remove it, or start again without --resume"
    content = read_bytes(file, remedy)
    try:
        stored = json.loads(content)
        steps: dict[str, dict[str, Any]] = stored["steps"]
        belongs, is_whole = stored["fingerprint"] == fingerprint, _is_whole(stored)
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(f"{file} cannot be read ({error}): {remedy}") from error
    if not belongs:
        raise InputError(
            f"{file} belongs to other inputs or options: repeat those, or start again without "
            "--resume"
        )
    if not is_whole:
        raise InputError(f"{file} was altered since it was written: {remedy}")
    return steps


def _is_whole(stored: dict[str, Any]) -> bool:
    """Return whether the checksum of a file is that of its content."""
    content = {name: value for name, value in stored.items() if name != _CHECKSUM}
    return bool(stored.get(_CHECKSUM) == _checksum(content))


def _checksum(content: dict[str, Any]) -> str:
    """Return the SHA-256 of content as JSON; numbers read back exactly, so their text is one."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
