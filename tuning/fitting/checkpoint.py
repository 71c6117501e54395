"""Checkpoint of a tuning: finished steps in a file, from which an aborted tuning resumes.

A step (a stage of a start, or a fold) begins where the one before it ended and counts evaluations,
never time. Resumed tunings therefore give bit-identical results. Numbers are written so that they
read back exactly.
"""

import json
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from identification.words import InputError
from tuning.solvers.nlopt_solver import Minimum

CHECKPOINT_FILE = "tune.checkpoint.json"


class Checkpoint:
    """Finished steps by name.

    Args:
        file: file that keeps them; None keeps them in memory only.
        fingerprint: fingerprint of inputs and options; a file with another one is refused.
        resume: whether to read the file; otherwise it is replaced.

    Raises:
        InputError: a file to resume that cannot be read, or that belongs to another tuning.
    """

    def __init__(
        self, file: Path | None = None, fingerprint: str = "", *, resume: bool = False
    ) -> None:
        self._file, self._fingerprint = file, fingerprint
        self._steps: dict[str, dict[str, Any]] = {}
        if resume and file is not None and file.is_file():
            self._steps = _read(file, fingerprint)

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
            _write(self._file, {"fingerprint": self._fingerprint, "steps": self._steps})

    def run_step(self, name: str, make: Callable[[], Minimum]) -> Minimum:
        """Return a finished step, or make it now and keep it."""
        end = self.recall(name)
        if end is None:
            end = make()
            self.keep(name, end)
        return end

    def close(self) -> None:
        """Remove the file once the results are written."""
        if self._file is not None:
            self._file.unlink(missing_ok=True)


def _read(file: Path, fingerprint: str) -> dict[str, dict[str, Any]]:
    """Read the finished steps of a file; refuse another fingerprint."""
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        steps: dict[str, dict[str, Any]] = content["steps"]
        matches = content["fingerprint"] == fingerprint
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"{file} cannot be read ({error}): remove it, or start again without --resume"
        ) from error
    if not matches:
        raise InputError(
            f"{file} belongs to other inputs or options: repeat those, or start again without "
            "--resume"
        )
    return steps


def _write(file: Path, content: dict[str, Any]) -> None:
    """Replace the file in one operation, so that a reader finds either the old or the new one."""
    handle, name = tempfile.mkstemp(dir=file.parent, prefix=".checkpoint-")
    with os.fdopen(handle, "w", encoding="utf-8") as stream:
        json.dump(content, stream)
        stream.flush()
        os.fsync(stream.fileno())
    Path(name).replace(file)
