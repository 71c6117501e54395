"""Run an entry on a set of campaigns: one case after the other, bounded, resumable."""

import json
import math
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gapbench.answer import AnswerError, read_answer

STRATA = ("exact", "dirty", "several", "force", "levels", "real")
DEFAULT_SECONDS = 600.0  # core seconds of a case
WAITING_FACTOR = 5  # seconds of the clock for each of a core: other work may share the machine
ANSWER = "answer.json"


class RunError(Exception):
    """A set or a file of answers cannot be used; the message says what to do."""


@contextmanager
def open_set(path: Path) -> Iterator[tuple[Path, Mapping[str, Any]]]:
    """Yield the folder of a set and its keys; a .zip is unpacked for the time being.

    Raises:
        RunError: it is no set.
    """
    with tempfile.TemporaryDirectory() as unpacked:
        folder = path
        if path.suffix == ".zip" and path.is_file():
            shutil.unpack_archive(path, unpacked)
            folder = Path(unpacked)
        try:
            keys = json.loads((folder / "keys.json").read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise RunError(f"{path}: is no set with keys.json ({error})") from error
        yield folder, keys


def read_rows(path: Path) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """Return the head of a file of answers, and its rows by case; a line that is cut is left out.

    Raises:
        RunError: the file has no head of a run.
    """
    rows = []
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            rows.append(json.loads(line))
        except ValueError:
            continue
    if not rows or "command" not in rows[0]:
        raise RunError(f"{path}: is no file of answers of gapbench run")
    return rows[0], {row["case"]: row for row in rows[1:]}


def run_entry(
    command: Sequence[str],
    folder: Path,
    keys: Mapping[str, Any],
    out: Path,
    *,
    seconds: float = DEFAULT_SECONDS,
    strata: Sequence[str] | None = None,
    limit: int | None = None,
) -> None:
    """Run a command on the cases of a set that have no answer yet; each answer is kept at once.

    The command gets the path of a copy of the campaign as its last argument. It prints its answer,
    or writes ``answer.json`` into that folder. An answer after too many core seconds, or
    five times as many of the clock, counts as none.

    Args:
        command: words of the command.
        folder, keys: set of ``open_set``.
        out: file of answers.
        seconds: core seconds of a case, at most.
        strata: these strata alone.
        limit: the first cases alone.

    Raises:
        RunError: there is no such command, or the file holds answers of another command or set.
        KeyboardInterrupt: interrupted; the case that ran is run again the next time.
    """
    _check_command(command)
    head = {"command": list(command), "seed": keys["seed"], "seconds": seconds}
    rows: dict[str, dict[str, Any]] = {}
    if out.exists() and out.stat().st_size:
        before, rows = read_rows(out)
        if before != head:
            raise RunError(f"{out}: holds answers of another run, {before}; name another --out")
        if not out.read_bytes().endswith(b"\n"):
            with out.open("a", encoding="utf-8") as file:
                file.write("\n")
    else:
        out.write_text(json.dumps(head) + "\n", encoding="utf-8")
    names = [n for n, key in keys["cases"].items() if not strata or key["stratum"] in strata]
    for number, name in enumerate(names[:limit], start=1):
        if name in rows:
            continue
        row = {
            "case": name,
            **_run_case(command, folder / name, frozenset(keys["effects"]), seconds),
        }
        with out.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
        said = row.get("error", "answered")
        cost = f"{row['core_seconds']:.1f} core seconds"
        print(f"{number}/{len(names[:limit])} {name}: {said}, {cost}", file=sys.stderr, flush=True)


def _check_command(command: Sequence[str]) -> None:
    """Refuse a command that cannot be run, before a file says that it ran."""
    if not command:
        raise RunError("give the command that answers: gapbench run -- python mine.py")
    if shutil.which(command[0]) is None:
        remedy = "name a program in PATH, or an executable file"
        if len(command[0].split()) > 1:
            remedy = f"do not quote it as one word: gapbench run -- {command[0]}"
        raise RunError(f"{command[0]}: there is no such command: {remedy}")


def _run_case(
    command: Sequence[str], campaign: Path, effects: frozenset[str], seconds: float
) -> dict[str, object]:
    """Return answer or error of a case, and its cost."""
    with tempfile.TemporaryDirectory() as place:
        copy = Path(place) / "campaign"  # the entry sees neither keys nor other cases
        shutil.copytree(campaign, copy)
        began, spent = time.monotonic(), _child_seconds()
        process = subprocess.Popen(
            [*command, str(copy)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        most = math.ceil(seconds)
        resource.prlimit(process.pid, resource.RLIMIT_CPU, (most, most + 1))
        error = output = messages = ""
        try:
            output, messages = process.communicate(timeout=WAITING_FACTOR * seconds)
        except subprocess.TimeoutExpired:
            error = f"no answer within {WAITING_FACTOR * seconds:g} s"
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.communicate()
        core = _child_seconds() - spent
        cost = {"core_seconds": round(core, 3), "seconds": round(time.monotonic() - began, 3)}
        if not error and (core > seconds or process.returncode == -signal.SIGXCPU):
            error = f"took {core:.1f} core seconds; at most {seconds:g}"
        if not error and process.returncode:
            error = f"ended with {process.returncode}: {messages.strip().rpartition(chr(10))[2]}"
        if error:
            return {"error": error, **cost}
        written = copy / ANSWER
        text = written.read_text(encoding="utf-8") if written.is_file() else output
        try:
            read_answer(text, effects)
        except AnswerError as wrong:
            return {"error": str(wrong), **cost}
        return {"answer": json.loads(text), **cost}


def _child_seconds() -> float:
    """Return the core seconds of all children that have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime
