"""Strict reading of JSON that somebody else wrote: whatever is wrong becomes one sentence."""

import json
import math
from collections.abc import Mapping
from pathlib import Path

from truth.errors import TruthError

LARGEST = 5_000_000  # bytes of a file
BOUND = 1e30  # no quantity in SI units is larger; squares and ratios stay finite


def read_bytes(path: Path, largest: int = LARGEST) -> bytes:
    """Return a file's content.

    Raises:
        TruthError: it is missing, no file, or larger than allowed.
    """
    try:
        size = path.stat().st_size
        if size > largest:
            raise TruthError(f"{path.name}: has {size} bytes; at most {largest} are read")
        return path.read_bytes()
    except OSError as error:
        raise TruthError(f"{path.name}: cannot be read ({error.strerror})") from error


def read_json(path: Path) -> object:
    """Return a JSON file's value.

    Raises:
        TruthError: the file is missing, too large, no JSON, holds NaN or infinity, or a key twice.
    """
    content = read_bytes(path)
    try:
        value: object = json.loads(content, parse_constant=_refuse, object_pairs_hook=_once)
    except ValueError as error:
        raise TruthError(f"{path.name}: is not JSON ({error})") from error
    except RecursionError as error:
        raise TruthError(f"{path.name}: is nested too deeply") from error
    return value


def table(value: object, what: str, *keys: str) -> Mapping[str, object]:
    """Return an object that has these keys; more are allowed."""
    if not isinstance(value, dict):
        raise TruthError(f"{what}: expected an object, got {_short(value)}")
    missing = [key for key in keys if key not in value]
    if missing:
        raise TruthError(f"{what}: {', '.join(missing)} is missing")
    return value


def items(value: object, what: str) -> list[object]:
    """Return a list."""
    if not isinstance(value, list):
        raise TruthError(f"{what}: expected a list, got {_short(value)}")
    return value


def text(value: object, what: str) -> str:
    """Return a string."""
    if not isinstance(value, str):
        raise TruthError(f"{what}: expected a string, got {_short(value)}")
    return value


def number(value: object, what: str, low: float = -BOUND, high: float = BOUND) -> float:
    """Return a finite number from low to high."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TruthError(f"{what}: expected a number, got {_short(value)}")
    try:
        converted = float(value)
    except OverflowError:
        converted = math.inf
    if not (math.isfinite(converted) and low <= converted <= high):
        raise TruthError(f"{what}: {_short(value)} is not finite, or not from {low:g} to {high:g}")
    return converted


def number_or_null(value: object, what: str, low: float = -BOUND) -> float | None:
    """Return a finite number, or None for a number that does not exist."""
    return None if value is None else number(value, what, low)


def _short(value: object) -> str:
    try:
        return repr(value)[:40]
    except ValueError:  # an integer of too many digits
        return "a number of very many digits"


def _refuse(constant: str) -> float:
    raise ValueError(f"{constant} is no number")


def _once(pairs: list[tuple[str, object]]) -> dict[str, object]:
    entries = dict(pairs)
    if len(entries) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"the key {twice[:40]!r} is given twice")
    return entries
