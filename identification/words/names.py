"""Lists of names as text."""

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
