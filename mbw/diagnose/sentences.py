"""A verdict in plain words: effects, places, directions, what is alike, what gates found."""

from collections.abc import Collection, Sequence

from diagnosis import PROVEN, catalogue
from diagnosis.inference.evidence import Evidence
from diagnosis.labels import direction, named
from diagnosis.verdict.build import NONLINEAR
from diagnosis.verdict.schema import CauseRow, Verdict
from identification import FAULTS
from mbw.diagnose.effect_parameters import interval_words, may_be_nothing, parameter_words
from mbw.diagnose.schema import ShownFile

_WITHOUT_COHERENCE = (
    "without coherence, or with one average or none stated, the noise is estimated from third "
    "differences along frequency: too much where modes are sharp, so gaps weigh little there and "
    "an excess may fall below 1"
)
NOT_SHOWN = "lines that were left out do not show the gap shrink"
_SHARED = (
    "it cannot be told whether neighbouring lines have noise of their own, which a window in time, "
    "an average along frequency, sharp modes or few lines prevent: a gap is known only as well as "
    "the noise is, and small ones hide"
)
_LIKELY, _LIKELIER = 0.5, 10.0  # probability, and times as probable: then data do tell
_OTHERS = {"hardening": "a spring that hardens", "sensor_unknown": FAULTS["sensor_unknown"]}
_AT = {"joint": "at", "body": "on", "sensor": "at", "hammer": "at", "pair": "between"}
_NO_SUCH = "no effect here is of that kind: compare the hits of each level"
_UNTESTED: tuple[tuple[Collection[str], str], ...] = (
    (NONLINEAR, "only hits of several levels can show that"),
    ({"drift"}, "one direction of one set-up cannot show that"),
    (
        {"sensor_delay", "sensor_swap", "mount_resonance", "flexible_body"},
        "where a body has fewer than two channels to spare nothing shows that",
    ),
    (
        {"sensor_gain", "sensor_misalignment", "sensor_position", "hammer_misalignment"},
        "[tuning] or [tolerance] keeps some of that as drawn, and no fit moves it",
    ),
)


def kind(effect: str) -> str:
    """An effect as a noun."""
    known = catalogue().get(effect) or PROVEN.get(effect)
    if known is not None:
        return known.noun
    return _OTHERS.get(effect, effect.replace("_", " "))


def place(location: str) -> str:
    """``joint ty`` of ``joint:ty``, ``sensors acc1 and acc2`` of two."""
    what, _, name = location.partition(":")
    several = "s" if what == "sensor" and "+" in name else ""
    return f"{what}{several} {named(location)}"


def placed(location: str) -> str:
    """The same with its preposition: ``on body ty``."""
    what, _, name = location.partition(":")
    if what == "pair":
        return f"between {name}"
    return f"{_AT.get(what, 'at')} {place(location)}"


def cause_words(row: CauseRow) -> str:
    """Effect, place and direction."""
    towards = direction(row.dof)
    towards = f", {towards}" if towards else ""
    return f"{kind(row.effect)} {placed(row.location)}{towards}"


def cause_parameters(row: CauseRow) -> str:
    """Its parameters with their units, one after the other.

    Of a size that may be nothing it is the interval, and what goes with it is not known.
    """
    doubtful = may_be_nothing(row.interval)
    found = []
    for name, value in row.parameters.items():
        if name in doubtful:
            low, high = (float(end) for end in row.interval[name])  # type: ignore[arg-type]
            found.append(interval_words(row.effect, row.dof, name, (low, high)))
        elif doubtful:
            found.append(f"{name.replace('_', ' ')} not known")
        else:
            found.append(parameter_words(row.effect, row.dof, name, value))
    return ", ".join(found)


def closed_words(closed: float, ends: tuple[float, float] | None) -> str:
    """How much of a gap is closed, with its interval if there is one.

    A jackknife knows nothing of bounds, but no more than all of a gap is closed. Where a gap is
    small beside what a whole mode costs that is left out, it may seem to grow.

    Args:
        closed: the part of it.
        ends: of its interval.
    """
    if closed < 0:
        return f"{NOT_SHOWN}: it is small beside what they cost; neighbouring lines tell it"
    told = ""
    if ends is not None:
        low, high = (min(end, 1.0) for end in ends)
        told = f" (95 %: {low:.1%} to {high:.1%})"
    return f"{min(closed, 1.0):.1%} of the gap beyond noise is closed{told}"


def site_words(site: str) -> str:
    """Such as ``appendage@body:ty``, as twins have it."""
    effect, _, location = site.partition("@")
    return f"{kind(effect)} {placed(location)}"


def noise_sentences(evidence: Evidence) -> list[str]:
    """What is lost where the noise is not known by coherences, or lines may share it."""
    found = [_WITHOUT_COHERENCE] if evidence.variance == "differences" else []
    return found if evidence.serial is not None else [*found, _SHARED]


def shared_sentences(evidence: Evidence) -> list[str]:
    """What neighbouring lines share of what is left, by which the verdict is judged."""
    if evidence.serial is None or not (evidence.refits or evidence.pairs):
        return []
    least = min(one.gap for one in (*evidence.refits, *evidence.pairs))
    before, after = (f"{max(one, 0.0) ** 0.5:.2g}" for one in (evidence.gap, least))
    return [
        f"Neighbouring lines share, of what the fit leaves, {before} times the noise without any "
        f"effect and {after} with the best; noise alone shares next to nothing."
    ]


def twin_sentences(verdict: Verdict) -> list[str]:
    """Which causes are hard to tell apart, set by set, and whether these data prefer one."""
    shares = {f"{one.effect}@{one.location}": one.probability for one in verdict.causes}
    found = []
    for alike in _sets(verdict.twins):
        sites = sorted(alike, key=lambda site: (-shares.get(site, 0.0), site))
        more, less, *_ = (shares.get(site, 0.0) for site in sites)
        names = _listed([site_words(site) for site in sites])
        if more > _LIKELY and more >= _LIKELIER * less:
            found.append(
                f"{capital(names)} are hard to tell apart: tuned to the end, these data prefer "
                f"the first, {percent_sure(more)} to {percent_sure(less)}."
            )
        else:
            found.append(f"These data hardly tell {names} apart.")
    return found


def _sets(pairs: Sequence[tuple[str, str]]) -> list[set[str]]:
    """Who is a twin of whom, or of a twin of whom, in one set."""
    found: list[set[str]] = []
    for pair in pairs:
        own = [one for one in found if one.intersection(pair)]
        found = [one for one in found if one not in own]
        found.append(set(pair).union(*own))
    return found


def capital(text: str) -> str:
    """Such as begins a sentence."""
    return text[0].upper() + text[1:]


def untested_sentences(verdict: Verdict, levels: int) -> list[str]:
    """What this kind of data cannot show, and why.

    Args:
        verdict: which says what.
        levels: of the hits, how many.
    """
    found = []
    for effects, reason in _UNTESTED:
        why = _NO_SUCH if effects is NONLINEAR and levels > 1 else reason
        hidden = [kind(one) for one in verdict.not_testable if one in effects]
        if hidden:
            found.append(f"Not tested, so not excluded: {_listed(hidden)}; {why}.")
    return found


def gate_sentences(shown: ShownFile) -> list[str]:
    """Sensors that were taken out, bodies whose channels were doubted."""
    found = []
    for one in shown.taken_out:
        channels = "channel" if one.dof is not None and "+" not in one.dof else "channels"
        towards = direction(one.dof)
        towards = f" {towards}" if towards else ""
        text = place(one.location)
        found.append(
            f"{capital(text)}{towards}: {kind(one.effect)}, proven by the spare "
            f"channels of the body; the {channels} took no part in the search."
        )
    for body in shown.doubted:
        found.append(
            f"Body {body} bends: its channels counted with so much doubt as they deviate from a "
            "solid."
        )
    return found


def percent_sure(probability: float) -> str:
    """Whole per cent, without a false certainty."""
    if probability < 0.005:
        return "< 1 %"
    return "> 99 %" if probability > 0.995 else f"{100 * probability:.0f} %"


def _listed(words: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))
