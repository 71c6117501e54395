"""Sentences on what remains with the established causes, and on proven faults that are none."""

from diagnosis.inference.evidence import Evidence
from diagnosis.settings import SETTINGS
from diagnosis.verdict.schema import RemarkRow, Verdict, Where
from diagnosis.verdict.sentences import capitalise, cause_words, effect_noun, place_phrase
from identification.words import percent_text
from mbw.diagnose.fitted_sets import FittedRow, fitted_rows
from mbw.diagnose.sentences import format_probability
from mbw.page.numbers import format_closed

_MAX_NAMED_PLACES = 2  # places of a local rest that a sentence names


def model_error_words(model_error: float) -> str:
    """Return a relative model error as text, such as ``2.1 % of the motion``."""
    return f"{percent_text(model_error)} of the motion"


def rest_sentence(verdict: Verdict, evidence: Evidence) -> str | None:
    """Return what remains; None where nothing significant does.

    Args:
        verdict: verdict with the rest.
        evidence: fits of the single candidates.
    """
    rest = verdict.rest
    if rest is None or not rest.significant:
        return None
    error = model_error_words(rest.model_error)
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
    effect, location, _ = row.keys[0]
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

    Args:
        evidence: everything that was fitted.
    """
    rows = [
        row
        for row in fitted_rows(evidence)
        if len(row.keys) == 1
        and row.closed is not None
        and row.closed >= SETTINGS.min_closed
        and not row.is_outlier
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
