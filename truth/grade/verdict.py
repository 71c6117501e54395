"""A verdict in plain values, and what its probabilities say of each hypothesis alone.

The names that verdicts and answers share: effects, where they sit, and locations.

The table is that of the contract of the files, written down once more on this side: a judge must
not take what is right from those whom it judges.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TypeAlias

from truth.errors import TruthError

KINDS = ("joint", "body", "sensor", "hammer", "pair")
NONE, UNEXPLAINED, SEVERAL = "none", "unexplained", "several"


@dataclass(frozen=True)
class Entry:
    """Properties of an effect of the catalogue.

    Args:
        kind: of its place.
        size: the parameter that tells how strong it is; empty if none does.
        neutral: value of that parameter at which there is no effect.
    """

    kind: str
    size: str = ""
    neutral: float = 0.0


CATALOGUE: Mapping[str, Entry] = MappingProxyType(
    {
        "mass_error": Entry("body", "mass"),
        "appendage": Entry("body", "mass"),
        "flexible_body": Entry("body"),
        "gyroscopic": Entry("body", "angular_momentum"),
        "joint_coupling": Entry("joint", "offset"),
        "missing_dof": Entry("joint", "stiffness"),
        "structural_damping": Entry("joint", "loss_factor"),
        "viscoelastic": Entry("joint", "ratio"),
        "inertance": Entry("joint", "inertance"),
        "stiffness": Entry("joint", "factor", 1.0),
        "damping": Entry("joint", "factor", 1.0),
        "feedback_delay": Entry("joint", "delay"),
        "support_loss": Entry("joint", "fraction", 1.0),
        "friction": Entry("joint", "k"),
        "backlash": Entry("joint", "gap"),
        "hardening": Entry("joint", "k3"),
        "parallel_path": Entry("pair", "stiffness"),
        "sensor_gain": Entry("sensor", "gain", 1.0),
        "sensor_polarity": Entry("sensor"),
        "sensor_misalignment": Entry("sensor", "rotation"),
        "sensor_position": Entry("sensor", "offset"),
        "sensor_swap": Entry("sensor"),
        "sensor_delay": Entry("sensor", "delay"),
        "mount_resonance": Entry("sensor", "frequency"),
        "hammer_misalignment": Entry("hammer", "rotation"),
        "drift": Entry("joint", "factor", 1.0),
        "hammer_gain": Entry("hammer", "gain", 1.0),
        "hammer_delay": Entry("hammer", "delay"),
        "hammer_position": Entry("hammer", "offset"),
    }
)

STATED = ("stiffness", "damping")  # need a state before, or a stated prior


def kind_of(location: str) -> str:
    """Return the kind of a location, ``joint`` of ``joint:ty``; empty of an empty one."""
    return location.partition(":")[0]


def canonical(location: str) -> str:
    """Return a location such that two names of one place become the same.

    ``sensor:a+b`` is ``sensor:b+a``, and a pair likewise. A body's name may have hyphens, so a
    pair is brought to the first, by alphabet, of all its turns at a hyphen.

    Raises:
        TruthError: the location is none.
    """
    kind, _, name = location.partition(":")
    if kind not in KINDS or not name:
        raise TruthError(f"location {location!r}: expected <kind>:<name>, {', '.join(KINDS)}")
    if kind == "sensor":
        sites = name.split("+")
        if "" in sites or len(set(sites)) < len(sites) or len(sites) > 2:
            raise TruthError(f"location {location!r}: expected one sensor, or two different ones")
        return f"sensor:{'+'.join(sorted(sites))}"
    if kind == "pair":
        parts = name.split("-")
        if len(parts) < 2 or "" in (parts[0], parts[-1]):
            raise TruthError(f"location {location!r}: expected pair:<lower body>-<upper body>")
        return "pair:" + min("-".join(parts[i:] + parts[:i]) for i in range(len(parts)))
    return location


def check_place(effect: str, location: str) -> str:
    """Return the canonical location of an effect of the catalogue.

    Raises:
        TruthError: the effect is unknown, or cannot sit there.
    """
    if effect not in CATALOGUE:
        raise TruthError(f"effect {effect!r} is not in the catalogue")
    place = canonical(location)
    if kind_of(place) != CATALOGUE[effect].kind:
        raise TruthError(f"{effect} at {location!r}: it sits at {CATALOGUE[effect].kind}:<name>")
    if "+" in place and kind_of(place) == "sensor" and effect != "sensor_swap":
        raise TruthError(f"{effect} at {location!r}: it sits at one sensor")
    return place


def direction(dof: str) -> str:
    """Return a direction such that ``tx+ty`` and ``ty+tx`` are the same; others stay."""
    known = dof.split("+")
    if all(len(part) == 2 and part[0] in "tr" and part[1] in "xyz" for part in known):
        return "+".join(sorted(known))
    return dof


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
