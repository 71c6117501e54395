"""Sentences on gaps: what causes close, and why held-out lines leave more than the fit."""

from diagnosis.inference.evidence import Evidence
from diagnosis.settings import SETTINGS
from diagnosis.verdict.schema import GapSteps
from mbw.page.numbers import format_closed

NOT_SHOWN = "the gap on held-out frequency lines does not shrink"
WHY_NOT_SHOWN = (
    "the effect is small compared with the loss of a whole block of lines; the correlation of "
    "neighbouring lines reveals it"
)
_MIN_HELD_OUT_RATIO = 2.0  # excess on held-out over that on fitted lines, which is explained


def closed_words(closed: float, ends: tuple[float, float] | None) -> str:
    """Return the closed share of the gap as text, with its interval if there is one.

    The jackknife does not know that a share lies between 0 and 1, so the ends are limited here. A
    small gap may seem to grow on lines that no fit saw.

    Args:
        closed: closed share of the gap.
        ends: ends of its interval; None if there is none.
    """
    if closed < 0:
        return f"{NOT_SHOWN}: {WHY_NOT_SHOWN}"
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
