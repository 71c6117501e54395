"""A verdict in plain values, and what its probabilities say of each hypothesis alone."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

from truth.grade.names import NONE, SEVERAL, UNEXPLAINED

Numbers: TypeAlias = tuple[float, ...]  # a scalar has one
Interval: TypeAlias = tuple[tuple[float, float], ...]  # of each component

EXPLAINED, PARTLY, FAILED = "explained", "partly", "failed"
WORDS = (NONE, EXPLAINED, SEVERAL, PARTLY, UNEXPLAINED)


@dataclass(frozen=True)
class Row:
    """A cause as stated.

    Args:
        effect: of the catalogue.
        location: canonical.
        probability: that it is present, alone or among several.
        dof: empty if it is not stated.
        parameters: SI, by name.
        interval: of parameters, by name.
        excess_after: excess with the cause in the model; None if it is not stated.
        places: canonical locations that the test cannot tell apart, the location among them.
    """

    effect: str
    location: str
    probability: float
    dof: str = ""
    parameters: Mapping[str, Numbers] = field(default_factory=dict)
    interval: Mapping[str, Interval] = field(default_factory=dict)
    excess_after: float | None = None
    places: tuple[str, ...] = ()

    def is_at(self, effect: str, location: str) -> bool:
        """Tell whether this is an effect at a location, or at places of which that is one."""
        return self.effect == effect and location in (self.location, *self.places)


@dataclass(frozen=True)
class StatedVerdict:
    """A verdict.

    Args:
        verdict: one of ``WORDS``; ``failed`` if there is none that could be read.
        none, unexplained, several: probabilities.
        causes: most probable first.
        where: canonical locations, most first, and their shares, if stated; None: no gap.
        twins: sets of ``(effect, location)``.
        retuned, after: excess; None if it does not exist.
    """

    verdict: str
    none: float = 0.0
    unexplained: float = 0.0
    several: float = 0.0
    causes: tuple[Row, ...] = ()
    where: tuple[tuple[str, float | None], ...] | None = None
    twins: tuple[frozenset[tuple[str, str]], ...] = ()
    retuned: float | None = None
    after: float | None = None


NOTHING_SAID = StatedVerdict(FAILED)


@dataclass(frozen=True)
class First:
    """The most probable hypothesis.

    Args:
        effect: of a cause, or none, unexplained, several; ``failed`` without any.
        place: of the cause; of several the most probable one's, of unexplained where most of the
            gap is; empty if there is none.
        probability: of the hypothesis.
        row: of a cause; None else.
    """

    effect: str
    place: str
    probability: float
    row: Row | None = None

    @property
    def places(self) -> tuple[str, ...]:
        """All places of the cause that the test cannot tell apart."""
        return (self.row.places if self.row else ()) or (self.place,)


def alone(verdict: StatedVerdict) -> tuple[float, ...]:
    r"""Return the probability of each cause alone, as a hypothesis of its own.

    A row tells that its cause is present, p_i = alone_i + q_i, q_i being that of all sets of
    several with it: at most that of all sets, v, and at most p_i. As the hypotheses sum to 1,

        sum q_i = excess = sum p_i - (1 - none - unexplained - several),

    and q_i = min(c p_i, v, p_i) with the one c that fits. So a verdict whose rows sum to the rest
    is taken as it stands.

    Returns:
        One for each row; with none, unexplained and several they sum to 1 at most, but for what
        the reader tolerates.
    """
    stated = [row.probability for row in verdict.causes]
    left = sum(stated) - (1 - verdict.none - verdict.unexplained - verdict.several)
    weight = sum(stated)
    probabilities = list(stated)
    # Whoever reaches a limit first, the largest, takes it; the others share what is left.
    for index in sorted(range(len(stated)), key=lambda i: -stated[i]):
        if left <= 0 or weight <= 0:
            break
        within = min(left / weight * stated[index], verdict.several, stated[index])
        probabilities[index] -= within
        left -= within
        weight -= stated[index]
    return tuple(max(0.0, probability) for probability in probabilities)


def first_of(verdict: StatedVerdict) -> First:
    """Return the most probable hypothesis; of equal ones that which the verdict's word names."""
    top = verdict.causes[0].location if verdict.causes else ""
    most = verdict.where[0][0] if verdict.where else ""
    hypotheses = [
        First(NONE, "", verdict.none),
        First(UNEXPLAINED, most, verdict.unexplained),
        First(SEVERAL, top, verdict.several),
    ]
    hypotheses += [
        First(row.effect, row.location, probability, row)
        for row, probability in zip(verdict.causes, alone(verdict), strict=True)
    ]
    best = max(
        hypotheses,
        key=lambda hypothesis: (hypothesis.probability, is_word_of(verdict.verdict, hypothesis)),
    )
    return best if best.probability > 0 else First(FAILED, "", 0.0)


def word_of(first: First) -> str:
    """Return the verdict's word for a hypothesis without a rest."""
    return EXPLAINED if first.row else first.effect


def is_word_of(word: str, first: First) -> bool:
    """Tell whether a verdict's word fits a hypothesis; ``partly`` fits any set of causes."""
    has_causes = first.row is not None or first.effect == SEVERAL
    return word == word_of(first) or (word == PARTLY and has_causes)


def twins_of(verdict: StatedVerdict, row: Row) -> frozenset[tuple[str, str]]:
    """Return a cause and all that the verdict calls its twins."""
    cause = (row.effect, row.location)
    return frozenset({cause}).union(*(group for group in verdict.twins if cause in group))
