"""Words of a diagnosis, for page and terminal: headline, probabilities, doubts, findings."""

from diagnosis.labels import name_direction
from diagnosis.settings import SETTINGS
from diagnosis.verdict.schema import CauseRow, Verdict
from diagnosis.verdict.sentences import (
    UNEXPLAINED,
    cause_words,
    place_name,
    place_phrase,
)
from identification.words import capitalise
from mbw.diagnose.effect_parameters import number
from mbw.diagnose.gap_sentences import (
    held_out_sentence,
    level_sentences,
    remark_sentences,
    rest_sentence,
)
from mbw.diagnose.sentences import (
    cause_parameters,
    confounded_sentences,
    format_probability,
    noise_sentences,
    places_sentences,
    serial_correlation_sentences,
    untested_sentences,
)
from mbw.page.html import badge
from mbw.page.numbers import format_closed, format_percent
from mbw.results.diagnosed_files import StoredDiagnosis

_MAX_EXCESS = 1.5  # gap with the cause over the noise; beyond, the cause is not all
_MIN_SECOND_PROBABILITY = 0.1  # of a second cause that the headline names
_OPENINGS = {"sensor": "One sensor is at fault", "hammer": "The hammer is at fault"}
_WHY_NOT_SHOWN = (
    "The effect is small compared with the loss of a whole block of lines; the correlation of "
    "neighbouring lines reveals it"
)
_WHY_OUTWEIGHED = "The errors that remain outweigh it where a block of lines is left out"
_MIN_FORCE_GAIN_NATS = 10.0  # gain in log likelihood of a free force that is believed


def lead(result: StoredDiagnosis) -> str:
    """Return the verdict, its cause with place and size, and the change of the gap."""
    word = result.verdict.verdict
    if word == "none":
        return _nothing_missing_lead(result)
    if word == "unexplained":
        return _unexplained_lead(result)
    rest = rest_sentence(result.verdict, result.evidence)
    return " ".join(
        [_causes(result), _shrinks(result), *([f"{capitalise(rest)}."] if rest else [])]
    )


def badges(result: StoredDiagnosis) -> str:
    """Return HTML of the probabilities, the stated one in colour, and of a rest."""
    word, posterior = result.verdict.verdict, result.verdict.probability
    single = max(0.0, 1 - posterior.none - posterior.unexplained - posterior.several)
    rows = (
        ("explained", "one cause", single),
        ("several", "several causes", posterior.several),
        ("unexplained", "unexplained", posterior.unexplained),
        ("none", "nothing missing", posterior.none),
    )
    stated: str = word
    if word == "partly":
        stated = "several" if len(result.shown.established) > 1 else "explained"
    pills = "".join(
        badge(
            f"{name} {format_probability(value)}", word != "unexplained" if key == stated else None
        )
        for key, name, value in rows
    )
    rest = result.verdict.rest
    if word == "partly" and rest is not None:
        pills += badge(
            f"a rest remains: model error {format_percent(rest.model_error)}", good=False
        )
    return pills


def doubts(result: StoredDiagnosis) -> list[str]:
    """Return sentences on what limits the figures of this verdict."""
    verdict, shown = result.verdict, result.shown
    sentences = list(shown.remarks)
    gap = verdict.gap
    sentences += [f"{text}." for text in remark_sentences(verdict)]
    is_all = verdict.verdict in ("explained", "several")
    if is_all and gap.after.excess is not None and gap.after.excess > _MAX_EXCESS:
        sentences.append(
            f"With the cause the gap is still {times(gap.after.excess)} the noise: further effects "
            "may be missing, the true cause may differ from this one, or a tolerance exceeds 2.5 "
            "standard deviations."
        )
    if shown.block is not None and (difference := held_out_sentence(gap, result.evidence)):
        sentences.append(difference)
    if shown.block is None:
        sentences.append(
            "The band is too narrow to hold frequency lines out: all figures refer to fitted lines."
        )
    return sentences + [f"{capitalise(text)}." for text in noise_sentences(result.evidence)]


def findings(result: StoredDiagnosis) -> list[str]:
    """Return sentences on what tells causes apart: levels, correlation, and what does not."""
    verdict, levels = result.verdict, len({test.level for test in result.shown.tests})
    return [
        *level_sentences(verdict),
        *serial_correlation_sentences(result.evidence),
        *places_sentences(verdict),
        *confounded_sentences(verdict),
        *untested_sentences(verdict, levels),
    ]


def times(excess: float | None) -> str:
    """Return an excess as text, such as ``5.1 times``."""
    return "an unknown number of times" if excess is None else f"{number(excess)} times"


def undecided_words(verdict: Verdict) -> str:
    """Return a clause on rivals, one of which is probably present, but none by itself.

    Empty where no effect is probable, or a single one is.
    """
    posterior = verdict.probability
    rows = [row for row in verdict.causes if row.probability >= _MIN_SECOND_PROBABILITY]
    present = 1 - posterior.none - posterior.unexplained
    is_undecided = len(rows) > 1 and rows[0].probability < SETTINGS.min_probability <= present
    if not is_undecided:
        return ""
    listed = [f"{cause_words(row)} ({format_probability(row.probability)})" for row in rows]
    return (
        f"an effect is missing ({format_probability(present)}), but these data do not tell which: "
        f"{' or '.join(listed)}"
    )


def _nothing_missing_lead(result: StoredDiagnosis) -> str:
    gap, posterior = result.verdict.gap, result.verdict.probability
    return (
        f"Nothing is missing beyond tolerances and noise ({format_probability(posterior.none)}). "
        f"The gap of the re-tuned model is {times(gap.retuned.excess)} the noise {_on(result)}; "
        f"that of the nominal model (as drawn) is {times(gap.as_drawn.excess)}."
    )


def _unexplained_lead(result: StoredDiagnosis) -> str:
    gap, posterior = result.verdict.gap, result.verdict.probability
    sure = format_probability(posterior.unexplained)
    retuned = times(gap.retuned.excess)
    if result.evidence.unknown and result.verdict.where[0].location in result.evidence.unknown:
        sensors = ", ".join(place_name(location) for location in result.evidence.unknown)
        return (
            f"Neither the motion of a solid body nor a known sensor fault explains the signals of "
            f"{sensors} ({sure}). Without these signals the gap of the re-tuned model is {retuned} "
            f"the noise {_on(result)}: nothing else is missing."
        )
    lacks = undecided_words(result.verdict) or f"{UNEXPLAINED} ({sure})"
    text = (
        f"{capitalise(lacks)}: the gap of the re-tuned model is still {retuned} the noise "
        f"{_on(result)}."
    )
    proven = [row for row in result.verdict.causes if row.excess_after is not None]
    if proven:
        listed = "; ".join(_sized_cause(row) for row in proven)
        text = (
            f"Proven by the redundant channels: {listed}. In addition, {UNEXPLAINED} ({sure}): the "
            f"gap of the re-tuned model is {retuned} the noise, with that fault corrected still "
            f"{times(gap.after.excess)}, all {_on(result)}."
        )
    if rest := rest_sentence(result.verdict, result.evidence):
        text += f" {capitalise(rest)}."
    forces = [force for force in result.evidence.pushed if force.gain > _MIN_FORCE_GAIN_NATS]
    if result.verdict.rest is not None and result.verdict.rest.spread == "everywhere":
        return text
    if forces:
        first = forces[0]
        towards = name_direction(first.dof)
        text += (
            f" The missing force most probably acts {place_phrase(first.location)}"
            f"{towards and ', ' + towards}"
        )
        text += f"; second comes {place_name(forces[1].location)}." if len(forces) > 1 else "."
    else:
        text += " These data do not locate it."
    return text


def _causes(result: StoredDiagnosis) -> str:
    rows = result.verdict.causes
    if not rows:
        return "An effect is missing."
    established = [rows[row.cause] for row in result.shown.established] or rows[:1]
    if result.verdict.verdict == "several":  # of these some may close less than a fifth
        established = _list_joint_causes(result)
    listed = "; ".join(
        f"{_sized_cause(row)}, {format_probability(row.probability)}" for row in established
    )
    if result.verdict.verdict == "several":
        return f"Several effects are present: {listed}."
    if result.verdict.verdict == "partly":
        count = f"{len(established)} effects are" if len(established) > 1 else "One effect is"
        return f"{count} established, and a rest remains: {listed}."
    first, sure = rows[0], format_probability(rows[0].probability)
    opening = _OPENINGS.get(first.location.partition(":")[0], "One effect is missing")
    rivals = [row for row in rows[1:2] if row.probability > _MIN_SECOND_PROBABILITY]
    if not rivals:
        return f"{opening} ({sure}): {_sized_cause(first)}."
    rival = f"{cause_words(rivals[0])} ({format_probability(rivals[0].probability)})"
    return f"{opening}: most probably ({sure}) {_sized_cause(first)}, otherwise {rival}."


def _list_joint_causes(result: StoredDiagnosis) -> list[CauseRow]:
    """Return the causes that the verdict's fit has together, established or not."""
    established = {row.cause for row in result.shown.established}
    return [
        row
        for number, row in enumerate(result.verdict.causes)
        if number in established or row.excess_after is not None
    ]


def _sized_cause(row: CauseRow) -> str:
    words, sizes = cause_words(row), cause_parameters(row)
    return f"{words} ({sizes})" if sizes else words


def _shrinks(result: StoredDiagnosis) -> str:
    gap = result.verdict.gap
    them = "them" if len(_list_joint_causes(result)) > 1 else "it"
    retuned, after = times(gap.retuned.excess), times(gap.after.excess)
    if gap.after.excess is None:
        return (
            f"The gap of the re-tuned model is {retuned} the noise; its change with the cause is "
            "unknown, because no model of this cause exists yet."
        )
    if gap.closed is not None and gap.closed < 0:
        is_partly = result.verdict.verdict == "partly"
        why = _WHY_OUTWEIGHED if is_partly else _WHY_NOT_SHOWN
        return (
            f"The gap on held-out frequency lines does not shrink with {them}: it is {retuned} the "
            f"noise for the re-tuned model, and {after} with {them}. {why}."
        )
    text = (
        f"With {them} the gap falls from {retuned} the noise (re-tuned) to {after}, all "
        f"{_on(result)}"
    )
    if gap.closed is None:
        return f"{text}."
    closed = format_closed(gap.closed)
    return f"{text}: {closed} of the gap beyond the noise is closed."


def _on(result: StoredDiagnosis) -> str:
    return "on held-out frequency lines" if result.shown.block else "on the fitted frequency lines"
