"""Several hypotheses at once, joined for a refit."""

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce

from diagnosis.hypothesis import Hypothesis
from identification.words import Campaign


def join_hypotheses(several: Sequence[Hypothesis]) -> Hypothesis:
    """Several at once, called by the name of the first; what reforms the machine is one of them.

    Bodies that bend know of each other: each reforms the machine for all.
    """
    if len(several) == 1:
        return several[0]
    corrections = [hypothesis.correct for hypothesis in several if hypothesis.correct is not None]

    def correct(campaign: Campaign) -> Campaign:
        return reduce(lambda seen, correction: correction(seen), corrections, campaign)

    return replace(
        several[0],
        release=tuple(name for hypothesis in several for name in hypothesis.release),
        parts=tuple(part for hypothesis in several for part in hypothesis.parts),
        begin={name: value for hypothesis in several for name, value in hypothesis.begin.items()},
        follow={
            name: target for hypothesis in several for name, target in hypothesis.follow.items()
        },
        linear=tuple(name for hypothesis in several for name in hypothesis.linear),
        correct=correct if corrections else None,
        reform=next(
            (hypothesis.reform for hypothesis in several if hypothesis.reform is not None), None
        ),
        is_modelled=all(hypothesis.is_modelled for hypothesis in several),
        members=tuple(several),
    )
