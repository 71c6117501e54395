"""Sentences on what remains with the established causes, and on small proven faults."""

from diagnosis.verdict.schema import RemarkRow, RestRow, Verdict, Where
from mbw.diagnose.sentences import capitalise, cause_words, format_probability, place_phrase

_MAX_NAMED_PLACES = 2  # places of a local rest that a sentence names


def model_error_words(model_error: float) -> str:
    """Return a relative model error as text, such as ``2.1 % of the motion``."""
    return f"{100 * model_error:.2g} % of the motion"


def rest_sentence(verdict: Verdict) -> str | None:
    """Return what remains; None where nothing significant does.

    Args:
        verdict: verdict with the rest.
    """
    rest = verdict.rest
    if rest is None or not rest.significant:
        return None
    error = model_error_words(rest.model_error)
    if verdict.verdict == "unexplained":
        return _describe_unexplained(rest, error)
    excess = "" if rest.excess is None else f" is {rest.excess:.3g} times the noise"
    opening = f"what remains{excess}" if excess else "a significant rest remains"
    spread = (
        "small errors everywhere, of which no single place explains most"
        if rest.spread == "everywhere"
        else f"it mainly arises {_places(rest.where)}"
    )
    return f"{opening}: the model's error is {error} at each sensor; {spread}"


def _describe_unexplained(rest: RestRow, error: str) -> str:
    """Return what an unexplained gap is like: everywhere, or at one place."""
    if rest.spread == "everywhere":
        return (
            f"the model's error is {error} everywhere: no single effect of the catalogue explains "
            "a fifth of it"
        )
    return (
        f"the model's error is {error} at each sensor: it mainly arises {_places(rest.where)}, "
        "where no effect of the catalogue explains a fifth of it"
    )


def remark_sentences(verdict: Verdict) -> list[str]:
    """Return a sentence on each proven fault that closes too little to be a cause."""
    return [
        f"{capitalise(cause_words(row))} is proven by the redundant channels, but it is no cause "
        f"of the gap{_share_words(row)}"
        for row in verdict.remarks
    ]


def _share_words(row: RemarkRow) -> str:
    if row.closed is None:
        return ""
    return f": it closes {100 * max(row.closed, 0.0):.2g} % of it"


def _places(where: list[Where]) -> str:
    """Return the first places with their shares, such as ``at joint ty (82 %)``."""
    named = [row for row in where if row.share is not None][:_MAX_NAMED_PLACES]
    if not named:
        return "at one place"
    return " or ".join(
        f"{place_phrase(row.location)} ({format_probability(row.share or 0.0)})" for row in named
    )
