"""Lines on a gap for the terminal, also where one of its numbers does not exist."""

NO_QUIET_CHANNEL = "the noise of every channel exceeds 30 % of its motion"


def describe_gap(error: float | None, excess: float | None) -> str:
    """Return error and excess as text; a number that does not exist is explained.

    Args:
        error: relative error over channels with little noise; None if there is no such channel.
        excess: error over noise, over all channels; None if no channel has a known noise.
    """
    if error is None and excess is None:
        return "unknown, because no channel has a known noise"
    shown = f"excess {number_text(excess)}"
    if error is None:
        return f"{shown}; {NO_QUIET_CHANNEL}, so no relative error is stated"
    return f"error {number_text(error)}, {shown}"


def number_text(value: float | None) -> str:
    """Return a number with three digits, or ``unknown``."""
    return "unknown" if value is None else f"{value:.3g}"
