"""Texts ``JOINT=RATE`` of hinges that spin at a constant rate."""

import math
from collections.abc import Sequence

from identification.words import UsageError, read_number


def parse_spin_rates(texts: Sequence[str]) -> dict[str, float]:
    """Return the rates [rad/s] of texts ``JOINT=RATE``, by joint.

    Raises:
        UsageError: a text is no such pair, or a joint is named twice.
    """
    rates: dict[str, float] = {}
    for text in texts:
        joint, equals, number = text.rpartition("=")
        rate = read_number(number)
        if not (equals and joint and math.isfinite(rate)):
            raise UsageError(f"--spin {text!r}: write JOINT=RATE in rad/s, such as spindle_rz=6.28")
        if joint in rates:
            raise UsageError(f"--spin names {joint!r} twice: give it one rate")
        rates[joint] = rate
    return rates
