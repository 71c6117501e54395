"""Sentences on gaps: what causes close, and why held-out lines leave more than the fit.

Sentences on what remains with the established causes, and on proven faults that are none.

Sentences on the gap at each level of the hits, and on laws that such tests cannot tell apart.
"""

from diagnosis.decision.established import RemarkRow
from diagnosis.decision.remaining_gap import Where
from diagnosis.estimates.gap_by_level import LevelGapRow
from diagnosis.inference.evidence import Evidence
from diagnosis.settings import SETTINGS
from diagnosis.verdict.schema import GapSteps, Verdict
from diagnosis.verdict.sentences import cause_words, effect_noun, place_phrase
from identification.words import capitalise, percent_text
from mbw.diagnose.effect_parameters import number
from mbw.diagnose.fitted_sets import FittedRow, fitted_rows, is_outlier
from mbw.diagnose.sentences import format_probability
from mbw.page.numbers import format_closed

_MIN_HELD_OUT_RATIO = 2.0  # excess on held-out over that on fitted lines, which is explained


def closed_words(closed: float, ends: tuple[float, float] | None) -> str:
    """Return the closed share of the gap as text, with its interval if there is one.

    The jackknife does not know that a share lies between 0 and 1, so the ends are limited here.

    Args:
        closed: closed share of the gap, not negative.
        ends: ends of its interval; None if there is none.
    """
    interval = ""
    if ends is not None:
        low, high = ("none" if end < 0 else f"{min(end, 1.0):.1%}" for end in ends)
        interval = f" (95 %: {low} to {high})"
    share = format_closed(closed)
    share = share if share.startswith("about") else f"{min(closed, 1.0):.1%}"
    return f"{share} of the gap beyond noise is closed{interval}"


def unestablished_words(closed: float, *, has_size: bool = True) -> str:
    """Return why a probable cause is not established.

    Args:
        closed: part of the gap of the fitted lines that it closes.
        has_size: whether the interval of its size leaves out no effect.
    """
    if not has_size:
        return "but the interval of its size holds no effect, so it is not established"
    if closed < 0:
        return "which grows with it, so it is not established"
    if closed < SETTINGS.min_closed:
        return f"less than {100 * SETTINGS.min_closed:g} %, so it is not established"
    return "but not of the gap on held-out lines, so it is not established"


def held_out_sentence(gap: GapSteps, evidence: Evidence) -> str | None:
    """Return why gaps on held-out lines exceed those of the fitted lines; None if they do not.

    Args:
        gap: gaps on held-out lines.
        evidence: fits to all lines.
    """
    held_out = gap.retuned.excess
    fitted = evidence.null.chi_square**0.5
    if held_out is None or held_out < _MIN_HELD_OUT_RATIO * max(fitted, 1.0):
        return None
    return (
        "Re-tuned and later gaps are those on held-out frequency lines. Fitted to all lines, the "
        f"re-tuned model leaves {fitted:.3g} times the noise: its parameters fit the lines that "
        "they saw."
    )


_MAX_NAMED_PLACES = 2  # places of a local rest that a sentence names


def rest_sentence(verdict: Verdict, evidence: Evidence) -> str | None:
    """Return what remains; None where nothing significant does.

    Args:
        verdict: verdict with the rest.
        evidence: fits of the single candidates.
    """
    rest = verdict.rest
    if rest is None or not rest.significant:
        return None
    error = f"{percent_text(rest.model_error)} of the motion"
    if verdict.verdict == "unexplained":
        opening = _describe_unexplained(verdict, rest.spread, error)
        return f"{opening}{_best_candidate_words(verdict, evidence)}"
    excess = "" if rest.excess is None else f" is {rest.excess:.3g} times the noise"
    opening = f"what remains{excess}" if excess else "a significant rest remains"
    spread = (
        "small errors everywhere, of which no single place explains most"
        if rest.spread == "everywhere"
        else f"it mainly arises {_places(rest.where)}"
    )
    return f"{opening}: the model's error is {error} at each sensor; {spread}"


def _describe_unexplained(verdict: Verdict, spread: str, error: str) -> str:
    """Return what an unexplained gap is like: everywhere, or at the places of the verdict."""
    if spread == "everywhere":
        return (
            f"the model's error is {error} at each sensor, of which no single place explains most: "
        )
    return (
        f"the model's error is {error} at each sensor and mainly arises {_places(verdict.where)}: "
    )


def _best_candidate_words(verdict: Verdict, evidence: Evidence) -> str:
    """Return the best single candidate, what it closes, and why it is not established."""
    row = find_best_candidate(evidence)
    if row is None or row.closed is None:
        return "no single effect that was refitted closes a fifth of the gap"
    effect, location, _ = row.fit.keys[0]
    shares = [
        cause.probability
        for cause in verdict.causes
        if (cause.effect, cause.location) == (effect, location)
    ]
    probability = max(shares, default=0.0)
    if row.rejection:
        why = f"it {row.rejection}"
    elif probability < SETTINGS.min_row_probability:
        why = f"its probability is below {100 * SETTINGS.min_row_probability:g} %"
    else:
        why = f"its probability is only {format_probability(probability)}"
    best = "best" if row.log_odds is None else "most probable"
    return (
        f"no cause is established; the {best} single candidate, {effect_noun(effect)} "
        f"{place_phrase(location)}, closes {format_closed(row.closed, 2)} of the gap, but {why}"
    )


def find_best_candidate(evidence: Evidence) -> FittedRow | None:
    """Return the most probable single effect; None if none closes a fifth of the gap.

    If all are rejected, it is the one that closes most. An effect that a tolerance within its usual
    spread explains is no candidate.
    """
    rows = [
        row
        for row in fitted_rows(evidence)
        if len(row.fit.keys) == 1
        and row.closed is not None
        and row.closed >= SETTINGS.min_closed
        and not is_outlier(row.fit, SETTINGS)
    ]
    weighed = [row for row in rows if row.log_odds is not None]
    if weighed:
        return max(weighed, key=lambda row: row.log_odds or 0.0)
    return max(rows, key=lambda row: row.closed or 0.0, default=None)


def remark_sentences(verdict: Verdict) -> list[str]:
    """Return a sentence on each proven fault that is no established cause."""
    return [f"{capitalise(cause_words(row))}{_share_words(row)}" for row in verdict.remarks]


def _share_words(row: RemarkRow) -> str:
    if row.effect == "dead_channel":
        return ": the search left this channel out"
    proven = " is proven without the model"
    if row.closed is None:
        return f"{proven}, but is not established as a cause of the gap"
    share = f"{format_closed(row.closed, 2)} of the gap"
    if row.closed < SETTINGS.min_closed:
        return f"{proven}, but it closes only {share}"
    return f"{proven} and would close {share}: correct it first and repeat"


def _places(where: list[Where]) -> str:
    """Return the first places with their shares, such as ``at joint ty (82 %)``."""
    named = [row for row in where if row.share is not None][:_MAX_NAMED_PLACES]
    if not named:
        return "at one place"
    return " or ".join(
        f"{place_phrase(row.location)} ({format_probability(row.share or 0.0)})" for row in named
    )


_MIN_STATED_PROBABILITY = 0.5  # of a cause whose law is stated


def level_sentences(verdict: Verdict) -> list[str]:
    """Return sentences on the gap at each level, on a foretold level and on laws that look alike.

    Args:
        verdict: verdict with its gap.
    """
    sentences = []
    steps = [words for row in verdict.gap.levels if (words := _fall_words(row))]
    if steps:
        sentences.append(f"Gap in times the noise, level by level: {', '.join(steps)}.")
    foretold = verdict.gap.foretold
    if foretold is not None and (words := _fall_words(foretold)):
        sentences.append(
            f"Fits to the other levels alone foretell the tests at {words}: without the effect, "
            "then with it."
        )
    for cause in verdict.causes:
        if cause.laws and cause.probability >= _MIN_STATED_PROBABILITY:
            laws = f"{', '.join(cause.laws[:-1])} or {cause.laws[-1]}"
            sentences.append(
                f"The {effect_noun(cause.effect)} may be a {laws} element: FRFs at a few levels do "
                "not tell them apart."
            )
    return sentences


def _fall_words(row: LevelGapRow) -> str:
    """Return level and gap before and after, such as ``40 N 5.1 to 1.2``."""
    before, after = row.retuned.excess, row.after.excess
    if before is None or after is None:
        return ""
    return f"{row.level:g} {row.unit} {number(before)} to {number(after)}"
