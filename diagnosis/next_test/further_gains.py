"""Gain of a further test: the smallest sizes that it shows beside those of the planned test."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.next_test.smallest_sizes import SmallestSize


@dataclass(frozen=True)
class FurtherGain:
    """Gain of a further test over the planned one.

    Args:
        name: of the further test.
        findable: effects and places of which nine tests of ten find a usual size.
        findable_before: how many they are in the test as it is.
        compared: number of effects and places.
        shrink: geometric mean of the smallest sizes over those of the test as it is, of what both
            find; 1 if there is none.
        most: the effect that gains most, at its smallest size before.
        most_after: the same at its smallest size after.
    """

    name: str
    findable: int
    findable_before: int
    compared: int
    shrink: float
    most: SmallestSize | None
    most_after: SmallestSize | None


def compare_sizes(
    name: str, before: Sequence[SmallestSize], after: Sequence[SmallestSize]
) -> FurtherGain:
    """Return what a further test shows of the effects and places that the test as it is has.

    Args:
        name: of the further test.
        before: sizes in the test as it is.
        after: sizes with the further test.
    """
    with_it = {_key(row): row for row in after}
    pairs = [(row, with_it[_key(row)]) for row in before if _key(row) in with_it]
    ratios = [
        float(new.of_usual / old.of_usual) for old, new in pairs if old.of_usual and new.of_usual
    ]
    sized = [(old, new) for old, new in pairs if new.value is not None and new.is_found]
    most = min(sized, key=lambda pair: _ratio(*pair), default=(None, None))
    return FurtherGain(
        name,
        sum(_is_findable(new) for _, new in pairs),
        sum(_is_findable(old) for old, _ in pairs),
        len(pairs),
        float(np.exp(np.mean(np.log(ratios)))) if ratios else 1.0,
        *most,
    )


def rank_gains(gains: Sequence[FurtherGain]) -> list[FurtherGain]:
    """Return further tests, the most helpful first: by what they find, then by the sizes."""
    return sorted(gains, key=lambda gain: (gain.findable_before - gain.findable, gain.shrink))


def _key(row: SmallestSize) -> tuple[str, str, str]:
    return row.effect, row.location, row.dof


def _is_findable(row: SmallestSize) -> bool:
    """Tell whether a usual size is found."""
    return row.is_found and (row.of_usual is None or row.of_usual <= 1)


def _ratio(old: SmallestSize, new: SmallestSize) -> float:
    """Return the smallest size after over that before; 0 where no size is found before."""
    return float((new.of_usual or np.inf) / old.of_usual) if old.of_usual else 0.0
