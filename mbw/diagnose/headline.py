"""What a diagnosis comes to, in one or two sentences, with its probabilities and warnings."""

from diagnosis.inference.evidence import Pushed
from diagnosis.labels import direction
from diagnosis.verdict.schema import CauseRow
from mbw.diagnose.effect_parameters import number
from mbw.diagnose.result import Result
from mbw.diagnose.sentences import (
    NOT_SHOWN,
    capital,
    cause_parameters,
    cause_words,
    noise_sentences,
    percent_sure,
    place,
    placed,
)
from mbw.page.html import badge
from mbw.page.numbers import percent

_LEFT = 1.5  # excess, beyond which the cause is not all
_RIVAL = 0.1  # probability of a second cause that is worth a word
_OPENING = {"sensor": "One sensor is at fault", "hammer": "The hammer is at fault"}
_SURE = 10.0  # nats: of a free force that is there


def lead(result: Result) -> str:
    """The verdict, its cause with place and size, and how far the gap shrinks."""
    word = result.verdict.verdict
    if word == "none":
        return _nothing(result)
    if word == "unexplained":
        return _unexplained(result)
    return f"{_causes(result)} {_shrinks(result)}"


def badges(result: Result) -> str:
    """HTML of the probabilities of what is no single cause, the verdict's own in colour."""
    word, seen = result.verdict.verdict, result.verdict.probability
    single = max(0.0, 1 - seen.none - seen.unexplained - seen.several)
    rows = (
        ("explained", "one cause", single),
        ("several", "several causes", seen.several),
        ("unexplained", "unexplained", seen.unexplained),
        ("none", "nothing missing", seen.none),
    )
    return "".join(
        badge(f"{name} {percent_sure(value)}", word != "unexplained" if key == word else None)
        for key, name, value in rows
    )


def doubts(result: Result) -> list[str]:
    """What limits the figures of this verdict."""
    verdict, shown = result.verdict, result.shown
    found = list(shown.remarks)
    gap = verdict.gap
    if gap.after.excess is not None and gap.after.excess > _LEFT:
        found.append(
            f"With the cause the model is still off by {times(gap.after.excess)} the noise: more "
            "is missing, it is not quite this, or a tolerance lies beyond 2.5 of its standard "
            "deviations."
        )
    if shown.block is None:
        found.append("The band is too narrow to hold lines out: all figures are of fitted lines.")
    return found + [f"{capital(text)}." for text in noise_sentences(result.evidence)]


def times(excess: float | None) -> str:
    """``5.1 times``, or that it is not known."""
    return "an unknown number of times" if excess is None else f"{number(excess)} times"


def pushed(result: Result) -> list[Pushed]:
    """Places where a free force explains something, most first."""
    return [one for one in result.evidence.pushed if one.gain > _SURE]


def _nothing(result: Result) -> str:
    gap, seen = result.verdict.gap, result.verdict.probability
    return (
        f"Nothing is missing beyond tolerances and noise ({percent_sure(seen.none)}). Re-tuned, "
        f"the model is off by {times(gap.retuned.excess)} the noise {_on(result)}; as drawn, by "
        f"{times(gap.as_drawn.excess)}."
    )


def _unexplained(result: Result) -> str:
    gap, seen = result.verdict.gap, result.verdict.probability
    if result.evidence.unknown and result.verdict.where[0].location in result.evidence.unknown:
        sensors = ", ".join(place(one) for one in result.evidence.unknown)
        return (
            f"What {sensors} reads no motion of a solid body and no known fault of a sensor "
            f"explains ({percent_sure(seen.unexplained)}). Without it, re-tuned, the model is off "
            f"by {times(gap.retuned.excess)} the noise {_on(result)}: nothing else is missing."
        )
    text = (
        f"Something is missing that no effect of the catalogue explains "
        f"({percent_sure(seen.unexplained)}): re-tuned, the model is still off by "
        f"{times(gap.retuned.excess)} the noise {_on(result)}."
    )
    proven = [row for row in result.verdict.causes if row.excess_after is not None]
    if proven:  # beside it
        listed = "; ".join(_sized(row) for row in proven)
        text = (
            f"Proven by the spare channels: {listed}. Beside it something is missing that no "
            f"effect of the catalogue explains ({percent_sure(seen.unexplained)}): re-tuned, the "
            f"model is off by {times(gap.retuned.excess)} the noise, with that mended still by "
            f"{times(gap.after.excess)}, all {_on(result)}."
        )
    pushes = pushed(result)
    if pushes:
        first = pushes[0]
        towards = direction(first.dof)
        text += f" It pushes most probably {placed(first.location)}{towards and ', ' + towards}"
        text += f"; next comes {place(pushes[1].location)}." if len(pushes) > 1 else "."
    else:
        text += " Where it pushes is not to be told."
    return text


def _causes(result: Result) -> str:
    rows = result.verdict.causes
    if not rows:
        return "Something is missing."
    if result.verdict.verdict == "several":
        corrected = [row for row in rows if row.excess_after is not None]
        present = corrected or [row for row in rows if row.probability > 0.5] or rows[:1]
        listed = "; ".join(f"{_sized(row)}, {percent_sure(row.probability)}" for row in present)
        return f"Several things are missing or wrong: {listed}."
    first, sure = rows[0], percent_sure(rows[0].probability)
    opening = _OPENING.get(first.location.partition(":")[0], "One thing is missing")
    rivals = [row for row in rows[1:2] if row.probability > _RIVAL]
    if not rivals:
        return f"{opening} ({sure}): {_sized(first)}."
    other = f"{cause_words(rivals[0])} ({percent_sure(rivals[0].probability)})"
    return f"{opening}: most probably ({sure}) {_sized(first)}, else {other}."


def _sized(row: CauseRow) -> str:
    words, sizes = cause_words(row), cause_parameters(row)
    return f"{words} ({sizes})" if sizes else words


def _shrinks(result: Result) -> str:
    gap = result.verdict.gap
    them = "them" if result.verdict.verdict == "several" else "it"
    if gap.after.excess is None:
        return (
            f"Re-tuned, the model is off by {times(gap.retuned.excess)} the noise; how far that "
            "shrinks with the cause is not known, for the model cannot hold it yet."
        )
    if gap.closed is not None and gap.closed < 0:
        return (
            f"{capital(NOT_SHOWN)} with {them}, {times(gap.retuned.excess)} the noise, re-tuned, "
            f"and {times(gap.after.excess)} then: it is small beside what they cost, and "
            "neighbouring lines tell it."
        )
    text = (
        f"With {them} the gap falls from {times(gap.retuned.excess)} the noise, re-tuned, to "
        f"{times(gap.after.excess)}, all {_on(result)}"
    )
    if gap.closed is None:
        return f"{text}."
    closed = percent(min(gap.closed, 1.0))
    return f"{text}: {closed} of what lay beyond the noise is closed."


def _on(result: Result) -> str:
    return "on lines that no fit saw" if result.shown.block else "on the fitted lines"
