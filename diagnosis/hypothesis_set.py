"""Several hypotheses at once, joined for a refit."""

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce

from diagnosis.hypothesis import Hypothesis
from identification.words import Campaign


def join_hypotheses(hypotheses: Sequence[Hypothesis]) -> Hypothesis:
    """Return one hypothesis for several at once, with the name of the first.

    Only the first reform of the machine is used: that of a body that bends adds the modes of all
    bodies that bend.
    """
    if len(hypotheses) == 1:
        return hypotheses[0]
    corrections = [
        hypothesis.correct for hypothesis in hypotheses if hypothesis.correct is not None
    ]

    def correct(campaign: Campaign) -> Campaign:
        return reduce(lambda corrected, correction: correction(corrected), corrections, campaign)

    return replace(
        hypotheses[0],
        release=tuple(name for hypothesis in hypotheses for name in hypothesis.release),
        parts=tuple(part for hypothesis in hypotheses for part in hypothesis.parts),
        begin={
            name: value for hypothesis in hypotheses for name, value in hypothesis.begin.items()
        },
        follow={
            name: target for hypothesis in hypotheses for name, target in hypothesis.follow.items()
        },
        linear=tuple(name for hypothesis in hypotheses for name in hypothesis.linear),
        correct=correct if corrections else None,
        reform=next(
            (hypothesis.reform for hypothesis in hypotheses if hypothesis.reform is not None), None
        ),
        is_modelled=all(hypothesis.is_modelled for hypothesis in hypotheses),
        members=tuple(hypotheses),
    )
