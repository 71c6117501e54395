"""Numbers and vectors as the verdict states them, with their intervals.

A component of a vector that no motion of the machine shows is None, and has no interval.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from identification.words import Real

Value = float | tuple[float | None, ...]
Ends = tuple[float, float] | tuple[tuple[float, float] | None, ...]  # one pair for each component

DAMPING_RATIO_EFFECTS = ("appendage", "flexible_body", "mount_resonance")
# Parameters that a factor on all FRFs scales: a mass, and whatever else adds to dynamic stiffness.
_SCALED = ("mass", "stiffness", "damping", "change", "inertance", "angular_momentum", "k", "k3")


class Vague(tuple[float | None, ...]):
    """Vector with a component that is a convention and not known: it has no interval."""

    __slots__ = ()


def state_shown(values: Sequence[float], is_shown: Sequence[bool]) -> tuple[float | None, ...]:
    """Return a vector without the components that nothing shows, which are None."""
    return tuple(value if shown else None for value, shown in zip(values, is_shown, strict=True))


def flatten_values(stated: Mapping[str, Value]) -> Real:
    """Return all numbers in a row, without components that nothing shows."""
    return np.array([number for value in stated.values() for number in _list_numbers(value)], float)


def _list_numbers(value: Value) -> list[float]:
    components = value if isinstance(value, tuple) else (value,)
    return [component for component in components if component is not None]


def pair_ends(stated: Mapping[str, Value], low: Real, high: Real) -> dict[str, Ends]:
    """Return the ends of each number, and those of each component of a vector.

    Args:
        stated: numbers and vectors, by name.
        low: lower ends, in the order of ``flatten_values``; (n,).
        high: upper ends; (n,).
    """
    intervals: dict[str, Ends] = {}
    place = 0
    for name, value in stated.items():
        size = len(_list_numbers(value))
        span = slice(place, place + size)
        pairs = zip(low[span].tolist(), high[span].tolist(), strict=True)
        if (high[span] > low[span]).any() and not isinstance(value, Vague):
            intervals[name] = (
                tuple(None if number is None else next(pairs) for number in value)
                if isinstance(value, tuple)
                else next(pairs)
            )
        place += size
    return intervals


def list_pairs(ends: Ends) -> list[tuple[float, float] | None]:
    """Return the ends of each component, or the one pair of a number."""
    low, high = ends[0], ends[-1]
    if isinstance(low, int | float) and isinstance(high, int | float):
        return [(low, high)]
    return [end for end in ends if not isinstance(end, int | float)]


def list_components(value: Value) -> Real:
    """Return a number or a vector as numbers; NaN where nothing shows a component."""
    row = value if isinstance(value, tuple) else (value,)
    return np.array([np.nan if each is None else each for each in row])


def end_at(limit: Value, fitted: Value, ends: Ends) -> Ends:
    """Return the interval of a fitted value without what lies beyond a limit of it."""
    clipped = []
    for pair, last, middle in zip(
        list_pairs(ends), list_components(limit), list_components(fitted), strict=True
    ):
        side = np.maximum if middle >= last else np.minimum
        clipped.append(
            None if pair is None else (float(side(pair[0], last)), float(side(pair[1], last)))
        )
    return tuple(clipped) if isinstance(fitted, tuple) or clipped[0] is None else clipped[0]


def may_be_zero(ends: Ends) -> bool:
    """Return whether an interval holds zero: of a vector, those of all known components.

    That of a size that cannot be negative begins at zero.
    """
    pairs = [pair for pair in list_pairs(ends) if pair is not None]
    return bool(pairs) and all(low <= 0 <= high for low, high in pairs)


def drop_undetermined(middle: Mapping[str, Value], intervals: dict[str, Ends]) -> dict[str, Ends]:
    """Return the intervals without those of numbers that depend on a size that may be zero.

    Of vectors only the size of the effect counts, its first parameter: a place may be zero.
    """
    size = next(iter(middle))
    doubtful = {
        name
        for name, ends in intervals.items()
        if may_be_zero(ends) and (name == size or not isinstance(middle[name], tuple))
    }
    return {name: ends for name, ends in intervals.items() if not doubtful or name in doubtful}


def find_scaled(effect: str, middle: Mapping[str, Value]) -> Real:
    """Return the numbers that scale with the calibration of a test, zero for all others."""
    return np.concatenate(
        [flatten_values({name: value}) * is_scaled(effect, name) for name, value in middle.items()]
    )


def is_scaled(effect: str, name: str) -> bool:
    """Return whether a stated number scales with the calibration: a mass, not a frequency."""
    return name in _SCALED and (name != "damping" or effect not in DAMPING_RATIO_EFFECTS)
