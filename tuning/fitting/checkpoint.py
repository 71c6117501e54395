"""What a tuning has finished, kept in a file, so that one that was killed goes on from there.

Every step (a stage of a start, a fold) begins where the one before it ended and counts
evaluations, never time: steps that are recalled instead of made again leave all later ones the same
bits. Numbers are written so that they read back exactly.
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

CHECKPOINT = "tune.checkpoint.json"


class Journal:
    """Finished steps by name.

    Args:
        file: where they are kept; nowhere if None.
        fingerprint: of inputs and options: steps of others are not recalled.
        resume: whether to recall what the file holds; else it is begun anew.

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
        """A finished step, or None."""
        found = self._steps.get(step)
        if found is None:
            return None
        return Minimum(**{**found, "x": np.array(found["x"])})

    def keep(self, step: str, end: Minimum) -> None:
        """Write a finished step down, whole or not at all; interrupted ones are not finished."""
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

    def step(self, name: str, make: Callable[[], Minimum]) -> Minimum:
        """A finished step, or one that is made now and kept."""
        found = self.recall(name)
        if found is None:
            found = make()
            self.keep(name, found)
        return found

    def close(self) -> None:
        """Remove the file: the results are written."""
        if self._file is not None:
            self._file.unlink(missing_ok=True)


def _read(file: Path, fingerprint: str) -> dict[str, dict[str, Any]]:
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        steps: dict[str, dict[str, Any]] = content["steps"]
        same = content["fingerprint"] == fingerprint
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"{file} cannot be read ({error}): remove it, or begin anew without --resume"
        ) from error
    if not same:
        raise InputError(
            f"{file} belongs to other inputs or options: repeat those, or begin anew without "
            "--resume"
        )
    return steps


def _write(file: Path, content: dict[str, Any]) -> None:
    """Replace the file in one step, so that a reader finds the old one or the new one."""
    handle, name = tempfile.mkstemp(dir=file.parent, prefix=".checkpoint-")
    with os.fdopen(handle, "w", encoding="utf-8") as stream:
        json.dump(content, stream)
        stream.flush()
        os.fsync(stream.fileno())
    Path(name).replace(file)
