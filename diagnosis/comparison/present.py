"""Hypotheses of the causes that a verdict calls present."""

from collections.abc import Sequence

from diagnosis.hypothesis import Hypothesis
from diagnosis.hypothesis_set import together
from diagnosis.inference.posterior import Posterior
from diagnosis.search.ladder import Search


def present_hypotheses(
    judged: Posterior, made: Sequence[Hypothesis], found: Search
) -> tuple[Hypothesis, ...]:
    """The hypotheses of the causes that are there: of a pair as they were fitted together."""
    known_as = {one.hypothesis.key: one.hypothesis for one in found.refits if one.hypothesis}
    known_as |= {one.key: one for one in made}
    present = set(judged.present)
    for pair in reversed(found.pairs):  # the best one last, which counts
        members = pair.hypothesis.members if pair.hypothesis else ()
        if present.issuperset(one.key for one in members):
            known_as |= {one.key: one for one in members}
    return tuple(known_as[key] for key in judged.present)


def join_present(present: tuple[Hypothesis, ...], found: Search) -> Hypothesis:
    """All that is present at once, as it was fitted if it was."""
    fitted = (pair.hypothesis for pair in found.pairs if pair.hypothesis)
    known = (one for one in fitted if set(one.members) == set(present))
    return next(known, None) or together(present)
