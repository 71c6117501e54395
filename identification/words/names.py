"""Lists of names, and shares in per cent, as text; numbers of a text."""

import math
from collections.abc import Sequence


def shorten_names(names: Sequence[object], longest: int = 6) -> str:
    """Return names in one line; where there are many, the last are replaced by their number.

    Args:
        names: what is listed.
        longest: number of entries that the line may have.
    """
    texts = [str(name) for name in names]
    if len(texts) > longest:
        texts = [*texts[: longest - 1], f"... ({len(texts)} in all)"]
    return ", ".join(texts)


def count_noun(count: int, noun: str, plural: str = "") -> str:
    """Return a count with its noun, such as ``2 bodies``; the plural ends in s if none is given."""
    return f"{count} {noun if count == 1 else plural or noun + 's'}"


def rounded_text(value: float, digits: int) -> str:
    """Return a number with some significant digits, separated thousands and no exponent."""
    return f"{float(f'{value:.{digits}g}'):,.15g}"


def capitalise(text: str) -> str:
    """Return a text with a capital first letter."""
    return text[:1].upper() + text[1:]


def read_number(text: str) -> float:
    """Return the number that a text states; nan where it is another text."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def percent_text(share: float, digits: int = 2) -> str:
    """Return a share in per cent with its unit, without an exponent: 0.998 gives ``100 %``.

    Args:
        share: share, 1 for 100 %.
        digits: significant digits; a number with more digits before its point keeps them all.
    """
    percent = 100 * share
    text = f"{percent:.{digits}g}"
    if "e+" in text:
        text = f"{percent:.0f}"
    elif "e-" in text:
        text = f"{percent:.{digits + 4}f}".rstrip("0").rstrip(".")
    return f"{text} %"
