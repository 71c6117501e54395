"""Check of the frequency band that a user states."""

from identification.words import UsageError


def check_band(band: tuple[float, float] | None) -> None:
    """Refuse a band whose limits are exchanged or equal.

    Args:
        band: lowest and highest frequency [Hz]; None where the user states none.

    Raises:
        UsageError: the first limit is not below the second.
    """
    if band is not None and not band[0] < band[1]:  # true for NaN, too
        raise UsageError(f"--band {band[0]:g} {band[1]:g}: give the lower frequency first")
