"""Cases of a long bench, kept one by one: an interrupted bench goes on from where it was.

Cases of a bench that is done are packed by ``gzip -9n``; those made later stand beside them.
With ``KEPT=1`` in the environment nothing is made nor written: figures are those of the cases that
are kept.
"""

import gzip
import hashlib
import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path

from tuning.workers.executors import use_processes
from tuning.workers.independent_calls import run_calls


def only_kept() -> bool:
    """Whether figures are asked for of what there is."""
    return bool(os.environ.get("KEPT"))


def cases(
    name: str,
    numbers: Sequence[int],
    make: Callable[[int], dict[str, object]],
    jobs: int = 1,
    stale: Callable[[dict], bool] | None = None,
) -> tuple[list[dict], Path]:
    """Make what is missing.

    Args:
        name: of the bench; its cases lie in ``results/<name>.cases.jsonl``.
        numbers: of the cases, in the order in which they are made.
        make: a row of one, to be kept as JSON.
        jobs: processes.
        stale: whether a row that is kept is to be made anew; its successor then counts.

    Returns:
        The rows that there are, by number, and the file, to be removed when they
        are used.
    """
    known, kept = of(name), _file(name)
    missing = [k for k in numbers if k not in known or (stale is not None and stale(known[k]))]
    if only_kept():
        missing = []
    is_cut = kept.is_file() and kept.read_bytes()[-1:] not in (b"", b"\n")
    with kept.open("a", encoding="utf-8") as file:
        if is_cut:
            file.write("\n")
        calls = [(make, (number,)) for number in missing]
        for result in run_calls(calls, use_processes(jobs)):
            number, row = missing[result.index], result.unwrap()
            known[number] = row
            file.write(json.dumps([number, row, _checksum(row)]) + "\n")
            file.flush()
    return [known[number] for number in sorted(numbers) if number in known], kept


def of(name: str) -> dict[int, dict]:
    """Rows that are kept, by number.

    Args:
        name: of the bench.
    """
    kept = _file(name)
    packed = kept.with_name(f"{kept.name}.gz")
    text = gzip.decompress(packed.read_bytes()).decode() if packed.is_file() else ""
    text += kept.read_text(encoding="utf-8") if kept.is_file() else ""
    lines = text.splitlines()
    rows: dict[int, dict] = {}
    for number, line in enumerate(lines, start=1):
        try:
            case, row, *checksum = json.loads(line)
            is_whole = not checksum or checksum[0] == _checksum(row)  # older lines have none
        except (ValueError, TypeError, RecursionError):
            is_whole = False
        if is_whole:
            rows[case] = row
        else:
            print(f"{kept.name}, line {number} was cut or altered: its case is made anew")
    return rows


def _file(name: str) -> Path:
    return Path(__file__).parent / "results" / f"{name}.cases.jsonl"


def _checksum(row: object) -> str:
    """Hash of a row as JSON, beside it in its line."""
    return hashlib.sha256(json.dumps(row, sort_keys=True).encode()).hexdigest()[:16]
