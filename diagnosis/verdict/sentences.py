"""A verdict in words: its sentence, and the nouns of effects and places."""

from diagnosis.decision.established import RemarkRow
from diagnosis.effects import PROVEN, load_catalogue
from diagnosis.labels import name_direction, name_place
from diagnosis.settings import SETTINGS
from diagnosis.verdict.schema import CauseRow, Verdict
from identification import FAULT_PHRASES
from identification.words import capitalise

UNEXPLAINED = (
    "the model lacks something, and no effect of the catalogue is established as its cause"
)
_OTHER_NOUNS = {"sensor_unknown": FAULT_PHRASES["sensor_unknown"]}
_PREPOSITIONS = {"joint": "at", "body": "on", "sensor": "at", "hammer": "at", "pair": "between"}


def verdict_sentence(verdict: Verdict) -> str:
    """Return what the model lacks, and how far the gap shrinks with it, in one sentence."""
    if verdict.verdict == "none":
        return "Nothing is missing beyond tolerances and noise."
    likely = _list_likely(verdict)
    if verdict.verdict == "unexplained" or not likely:
        return f"{capitalise(UNEXPLAINED)}."
    sentence = capitalise(" and ".join(map(cause_words, likely)))
    before, after = verdict.gap.retuned.excess, verdict.gap.after.excess
    if before is None or after is None:
        return f"{sentence}."
    return f"{sentence}: the gap falls from {before:.3g} to {after:.3g} times the noise."


def change_sentence(verdict: Verdict) -> str:
    """Return what changed between the states of a campaign, in one sentence."""
    if verdict.verdict == "none":
        return "Nothing changed beyond noise and what differs between the tests of itself."
    if not _list_likely(verdict):
        excess = verdict.gap.retuned.excess
        size = "" if excess is None else f" by {excess:.3g} times the noise"
        return (
            f"The tests differ{size} beyond what differs between them of itself, and no effect of "
            "the catalogue is established as the cause."
        )
    return verdict_sentence(verdict)


def _list_likely(verdict: Verdict) -> list[CauseRow]:
    """Return the probable causes, or the first where a lower threshold established it."""
    likely = [row for row in verdict.causes if row.probability >= SETTINGS.min_probability]
    is_established = verdict.verdict in ("explained", "partly")
    return likely or list(verdict.causes[:1] if is_established else ())


def effect_noun(effect: str) -> str:
    """Return the noun of an effect, such as ``a wrong gain``."""
    entry = load_catalogue().get(effect) or PROVEN.get(effect)
    if entry is not None:
        return entry.noun
    return _OTHER_NOUNS.get(effect, effect.replace("_", " "))


def place_name(location: str) -> str:
    """Return a location as text, such as ``joint ty`` or ``sensors acc1 and acc2``."""
    what, _, name = location.partition(":")
    several = "s" if what == "sensor" and "+" in name else ""
    return f"{what}{several} {name if what == 'pair' else name_place(location)}"


def place_phrase(location: str) -> str:
    """Return a location with its preposition, such as ``on body ty``."""
    what = location.partition(":")[0]
    name = name_place(location) if what == "pair" else place_name(location)
    return f"{_PREPOSITIONS.get(what, 'at')} {name}"


def cause_words(row: CauseRow | RemarkRow) -> str:
    """Return effect, place and direction of a cause; all places that the test cannot tell apart."""
    towards = name_direction(row.dof)
    towards = f", {towards}" if towards else ""
    places = " or ".join(map(place_phrase, [row.location, *other_places(row)]))
    return f"{effect_noun(row.effect)} {places}{towards}"


def other_places(row: CauseRow | RemarkRow) -> list[str]:
    """Return the places of a cause that the test cannot tell from its likeliest one."""
    places = row.places if isinstance(row, CauseRow) else []
    return [place for place in places if place != row.location]
