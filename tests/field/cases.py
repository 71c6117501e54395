"""Field cases: inputs that users' reports showed, what the command must do with each, and a check.

A case is a folder with ``case.toml`` and its input files. The command runs in a copy of the folder,
as a process of its own, with a limit of time: forked, so that packages are loaded once.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

import mbw.command
from identification.readers.campaign_toml import load_toml

INPUTS = Path(__file__).parent / "inputs"
_DEFAULT_LIMIT_S = 60.0  # s: a case takes a second or two; a loaded machine needs ten times that
_STREAMS = ("stdout.txt", "stderr.txt")
for _verb in ("identify", "tune", "diagnose", "predict", "simulate", "match"):
    import_module(f"mbw.{_verb}.verb")  # loaded once, for all processes that are forked
_SHOWN_CHARACTERS = 300  # of a message in the table


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Value(_Strict):
    """Numbers or texts that the JSON result must hold.

    ``path`` steps through the result: keys and indices with dots, ``*`` for every item of a list
    (``modes.*.frequency``). ``near`` gives the numbers within the relative ``tolerance``;
    ``equals`` gives the value itself.
    """

    path: str
    near: list[float] | float | None = None
    tolerance: float = 1e-3
    equals: Any = None


class Run(_Strict):
    """One call of the command, in the folder of the case, and what it must do.

    ``environment`` holds variables of the environment, in addition to those of the check.
    ``says`` are texts that stderr must contain, whatever their case; ``never`` must not be there.
    ``stdout`` is ``json`` if stdout must be one JSON value, ``empty`` if it must be empty.
    """

    command: list[str]
    environment: dict[str, str] = {}
    exit_code: int = 0
    says: list[str] = []
    never: list[str] = []
    stdout: Literal["json", "empty"] | None = None
    quiet: bool = False
    value: list[Value] = []


class Case(_Strict):
    """A situation of a user, what is right, and the calls that show it."""

    situation: str
    expected: str
    limit_s: float = _DEFAULT_LIMIT_S
    run: list[Run] = Field(min_length=1)


@dataclass(frozen=True)
class Outcome:
    """What a case gave.

    Attributes:
        name: folder of the case below ``inputs``.
        case: the case.
        faults: sentences on what was not as expected; empty if all was.
        got: exit codes and the first message, in one line.
    """

    name: str
    case: Case
    faults: tuple[str, ...]
    got: str


def case_names() -> list[str]:
    """Return the folders of all cases, relative to ``inputs``."""
    return sorted(str(path.parent.relative_to(INPUTS)) for path in INPUTS.rglob("case.toml"))


def read_case(name: str) -> Case:
    """Read the ``case.toml`` of a case."""
    return Case.model_validate(load_toml(INPUTS / name / "case.toml"))


def run_case(name: str) -> Outcome:
    """Run all calls of a case in a copy of its folder, and compare with what is expected."""
    case = read_case(name)
    faults: list[str] = []
    got: list[str] = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / Path(name).name
        shutil.copytree(INPUTS / name, folder, symlinks=True)
        for run in case.run:
            code, stdout, stderr = _call(run, folder, case.limit_s)
            got.append(f"exit {code}: {_first_sentence(stderr)}")
            faults += _faults(run, code, stdout, stderr, folder)
    return Outcome(name, case, tuple(faults), "; ".join(got))


def _call(run: Run, folder: Path, limit_s: float) -> tuple[int | str, str, str]:
    """Run the command in a folder; the exit code is ``timeout`` when it takes too long."""
    if run.environment:  # what it says about BLAS or the locale is read while Python starts
        return _call_new_process(run, folder, limit_s)
    process = get_context("fork").Process(target=_run_command, args=(run.command, folder))
    process.start()
    process.join(limit_s)
    if process.is_alive():
        process.kill()
        process.join()
        return "timeout", "", f"no answer within {limit_s:g} s"
    stdout, stderr = ((folder / name).read_text("utf-8", "replace") for name in _STREAMS)
    for name in _STREAMS:
        (folder / name).unlink()
    return process.exitcode or 0, stdout, stderr


def _run_command(command: list[str], folder: Path) -> None:
    """Run the command in a process that has its packages already; ends in its exit code."""
    os.chdir(folder)
    os.environ["COLUMNS"] = "100"
    for number, name in enumerate(_STREAMS, start=1):
        os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT), number)
    # Those of pytest write elsewhere.
    sys.stdout, sys.stderr = (os.fdopen(number, "w", closefd=False) for number in (1, 2))
    sys.argv = ["mbw", *command]
    mbw.command.main()


def _call_new_process(run: Run, folder: Path, limit_s: float) -> tuple[int | str, str, str]:
    """Run the command in a process of its own, in another environment."""
    # The folder of the project comes first, so that a checkout tests its own packages.
    project = str(Path(__file__).parents[2])
    environment = {**os.environ, "PYTHONPATH": project, "COLUMNS": "100", **run.environment}
    try:
        process = subprocess.run(
            [sys.executable, "-m", "mbw", *run.command],
            cwd=folder,
            env=environment,
            capture_output=True,
            timeout=limit_s,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return "timeout", "", f"no answer within {limit_s:g} s"
    decoded = [text.decode("utf-8", "replace") for text in (process.stdout, process.stderr)]
    return process.returncode, decoded[0], decoded[1]


def _faults(run: Run, code: int | str, stdout: str, stderr: str, folder: Path) -> list[str]:
    """Return what differs from the expectation, as sentences."""
    faults = []
    if code != run.exit_code:
        faults.append(f"exit code {code} instead of {run.exit_code}: {_first_sentence(stderr)}")
    plain = re.sub(r"\s+", " ", stderr).lower()
    faults += [f"stderr lacks {text!r}" for text in run.says if text.lower() not in plain]
    faults += [f"stderr says {text!r}" for text in run.never if text.lower() in plain]
    if "traceback" in plain:
        faults.append("stderr holds a traceback")
    if run.quiet and stderr.strip():
        faults.append(f"stderr is not empty: {_first_sentence(stderr)}")
    if run.stdout == "empty" and stdout.strip():
        faults.append("stdout is not empty")
    result: Any = None
    if run.stdout == "json" or (run.value and "--json" in run.command):
        try:
            result = json.loads(_json_text(run.command, stdout, folder))
        except (OSError, ValueError) as error:
            return [*faults, f"no JSON result: {error}"]
    return faults + [fault for value in run.value if (fault := _value_fault(value, result))]


def _json_text(command: list[str], stdout: str, folder: Path) -> str:
    target = command[command.index("--json") + 1]
    return stdout if target == "-" else (folder / target).read_text(encoding="utf-8")


def _value_fault(value: Value, result: Any) -> str | None:
    """Return a sentence if the result does not hold a value; None if it does."""
    try:
        actual = _step_through(result, value.path.split("."))
    except (KeyError, IndexError, TypeError, ValueError) as error:
        return f"{value.path} is missing ({type(error).__name__} {error})"
    if value.near is not None:
        numbers = np.asarray(actual, dtype=float)
        wanted = np.asarray(value.near, dtype=float)
        if numbers.shape != wanted.shape or not np.allclose(
            numbers, wanted, rtol=value.tolerance, atol=0
        ):
            return f"{value.path} = {np.round(numbers, 5).tolist()} instead of {wanted.tolist()}"
        return None
    return None if actual == value.equals else f"{value.path} = {actual!r}, not {value.equals!r}"


def _step_through(result: Any, steps: list[str]) -> Any:
    """Return what a path leads to; ``*`` collects a list."""
    for position, step in enumerate(steps):
        if step == "*":
            return [_step_through(item, steps[position + 1 :]) for item in result]
        result = result[int(step)] if isinstance(result, list) else result[step]
    return result


def _first_sentence(text: str) -> str:
    """Return the error of a run, or its first line, cut to a width."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("mbw: ")]
    chosen = (errors or lines or ["nothing on stderr"])[0]
    return chosen if len(chosen) <= _SHOWN_CHARACTERS else chosen[:_SHOWN_CHARACTERS] + " ..."
