"""Sampling period of control loops that act together."""

from collections.abc import Sequence

from identification.words import InputError, Loop


def sampling_period(loops: Sequence[Loop]) -> float:
    """Return the sampling period of loops [s]; 0 if they are continuous.

    Raises:
        InputError: loops of different periods, or sampled and continuous ones.
    """
    periods = {loop.controller.period_s for loop in loops}
    if len(periods) > 1:
        each = ", ".join(f"{loop.name} {_period_text(loop)}" for loop in loops)
        raise InputError(
            f"loops that act together must have one sampling period, but they are {each}: state "
            "all controllers with one period, or all as continuous ones with their delays"
        )
    return periods.pop() if periods else 0.0


def _period_text(loop: Loop) -> str:
    """Return the period of a loop in words."""
    period = loop.controller.period_s
    return f"sampled every {period:g} s" if period else "continuous"
