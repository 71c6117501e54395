"""Several hypotheses at once, joined for a refit."""

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce

from diagnosis.hypothesis import Hypothesis
from identification.words import Campaign


def together(several: Sequence[Hypothesis]) -> Hypothesis:
    """Several at once, called by the name of the first; what reforms the machine is one of them.

    Bodies that bend know of each other: each reforms the machine for all.
    """
    if len(several) == 1:
        return several[0]
    corrections = [one.correct for one in several if one.correct is not None]

    def correct(campaign: Campaign) -> Campaign:
        return reduce(lambda seen, own: own(seen), corrections, campaign)

    return replace(
        several[0],
        release=tuple(name for one in several for name in one.release),
        parts=tuple(part for one in several for part in one.parts),
        begin={name: value for one in several for name, value in one.begin.items()},
        follow={name: other for one in several for name, other in one.follow.items()},
        linear=tuple(name for one in several for name in one.linear),
        correct=correct if corrections else None,
        reform=next((one.reform for one in several if one.reform is not None), None),
        is_held=all(one.is_held for one in several),
        members=tuple(several),
    )
