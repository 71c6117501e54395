"""Values by their keys: all values of each key, or the first."""

from collections.abc import Hashable, Iterable
from typing import TypeVar

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


def group_by_key(pairs: Iterable[tuple[Key, Value]]) -> dict[Key, list[Value]]:
    """Return all values of each key, keys and values in the order of the pairs."""
    groups: dict[Key, list[Value]] = {}
    for key, value in pairs:
        groups.setdefault(key, []).append(value)
    return groups


def first_by_key(pairs: Iterable[tuple[Key, Value]]) -> dict[Key, Value]:
    """Return the first value of each key, in the order of the pairs."""
    first: dict[Key, Value] = {}
    for key, value in pairs:
        first.setdefault(key, value)
    return first
