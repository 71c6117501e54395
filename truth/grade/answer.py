"""Read a sealed answer: what a campaign's machine really has."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from truth.errors import TruthError
from truth.grade.json_reading import items, number, read_bytes, table, text
from truth.grade.verdict import (
    NONE,
    SEVERAL,
    UNEXPLAINED,
    Numbers,
    canonical,
    check_place,
    direction,
    kind_of,
)


@dataclass(frozen=True)
class TrueCause:
    """An effect that the machine has.

    Args:
        effect: of the catalogue, or ``unexplained``.
        location: canonical; empty if it is not stated.
        dof: empty if it is not stated.
        kind: of an effect outside the catalogue.
        ratio: survival ratio; None if it is not stated.
        parameters: SI, by name; a scalar has one component.
    """

    effect: str
    location: str = ""
    dof: str = ""
    kind: str = ""
    ratio: float | None = None
    parameters: Mapping[str, Numbers] = field(default_factory=dict)


@dataclass(frozen=True)
class Truth:
    """All that a machine has.

    Args:
        causes: the one that is graded first, first; empty for none.
        mistuned: nothing is wrong but stiffness and damping.
        machine: its name; empty if it is not stated.
        tags: how the case was drawn and tested, as far as it is stated.
        background: small imperfections that the machine has beside its causes, each by effect and
            location.
    """

    causes: tuple[TrueCause, ...] = ()
    mistuned: bool = False
    machine: str = ""
    tags: tuple[str, ...] = ()
    background: tuple[tuple[str, str], ...] = ()

    @property
    def effect(self) -> str:
        """The right hypothesis: an effect, none, unexplained or several."""
        if len(self.causes) > 1:
            return SEVERAL
        return self.causes[0].effect if self.causes else NONE

    @property
    def only(self) -> TrueCause | None:
        """The one cause, if it is one of the catalogue."""
        known = len(self.causes) == 1 and self.causes[0].effect != UNEXPLAINED
        return self.causes[0] if known else None

    @property
    def label(self) -> str:
        """The effect; apart are ``mistuned``, and what is outside the catalogue by its kind."""
        if self.effect == NONE and self.mistuned:
            return "mistuned"
        if self.effect == UNEXPLAINED and self.causes[0].kind:
            return f"{UNEXPLAINED}:{self.causes[0].kind}"
        return self.effect

    @property
    def places(self) -> tuple[str, ...]:
        """Canonical locations of the causes."""
        return tuple(cause.location for cause in self.causes if cause.location)


def read_answer(path: Path) -> Truth:
    """Read a sealed answer.

    Raises:
        TruthError: the file is missing, no TOML, or no answer.
    """
    try:
        given = tomllib.loads(read_bytes(path).decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise TruthError(f"{path.name}: is not TOML ({error})") from error
    return answer_from(given, path.name)


def answer_from(given: Mapping[str, object], name: str) -> Truth:
    """Read an answer that is parsed already.

    Raises:
        TruthError: it is no answer.
    """
    table(given, name, "effect")
    effect = text(given["effect"], f"{name}: effect")
    if effect == NONE:
        causes: tuple[TrueCause, ...] = ()
    elif effect == SEVERAL:
        causes = tuple(_cause(item) for item in items(given.get("cause"), "cause"))
        if len(causes) < 2:
            raise TruthError(f"{name}: several effects, but fewer than two [[cause]]")
    else:
        causes = (_cause(given),)
    drawn = table(given.get("drawn", {}), "drawn")
    machine = text(drawn.get("machine", ""), "drawn.machine")
    dirt = table(given.get("dirt", {}), "dirt")
    return Truth(causes, drawn.get("mistuned") is True, machine, _tags(drawn), _background(dirt))


def _background(dirt: Mapping[str, object]) -> tuple[tuple[str, str], ...]:
    """Return effect and location of every small imperfection that is stated."""
    rows = []
    for item in items(dirt.get("item", []), "dirt.item"):
        row = table(item, "dirt.item", "effect", "location")
        effect = text(row["effect"], "dirt.item.effect")
        rows.append((effect, check_place(effect, text(row["location"], "dirt.item.location"))))
    return tuple(rows)


def _cause(value: object) -> TrueCause:
    given = table(value, "cause", "effect")
    effect = text(given["effect"], "effect")
    location = text(given.get("location", ""), "location")
    if effect == UNEXPLAINED:
        location = canonical(location) if location else ""
    else:
        location = check_place(effect, location)
    ratio = given.get("ratio")
    return TrueCause(
        effect=effect,
        location=location,
        dof=direction(text(given.get("dof", ""), "dof")),
        kind=text(given.get("kind", ""), "kind"),
        ratio=None if ratio is None else number(ratio, "ratio", 0.0),
        parameters={
            name: tuple(number(part, name) for part in (raw if isinstance(raw, list) else [raw]))
            for name, raw in table(given.get("parameters", {}), "parameters").items()
        },
    )


def _tags(drawn: Mapping[str, object]) -> tuple[str, ...]:
    """Return what a case is called by how it was drawn and tested; what is not stated is not."""
    tags = []
    if isinstance(kind := drawn.get("kind"), str) and kind:
        tags.append(kind)
    for key, tag in (("nodes", "two hammer points"), ("levels", "several levels")):
        value = drawn.get(key)
        if isinstance(value, list) and len(value) > 1:
            tags.append(tag)
    setups = drawn.get("setups")
    if isinstance(setups, int) and setups > 1:
        tags.append("several set-ups")
    if drawn.get("coherence") is False:
        tags.append("no coherence")
    if drawn.get("dead") is not None:
        tags.append("dead channel")
    return tuple(tags)


def kinds_of(truth: Truth) -> tuple[str, ...]:
    """Return the kinds of a truth's places, each once; ``none`` without a place."""
    return tuple(dict.fromkeys(kind_of(place) for place in truth.places)) or (NONE,)
