"""Texts ``NAME=NUMBER`` of options, such as ``JOINT=RATE`` of hinges that spin."""

import math
from collections.abc import Sequence

from identification.words import UsageError, read_number


def read_assignment(option: str, text: str, form: str) -> tuple[str, float]:
    """Return name and number of a text ``NAME=NUMBER``.

    Args:
        option: name of the option, for the message.
        form: form of the text, with an example.

    Raises:
        UsageError: the text has no name or no finite number.
    """
    name, _, number = text.rpartition("=")
    value = read_number(number)
    if not (name and math.isfinite(value)):
        raise UsageError(f"{option} {text!r}: write {form}")
    return name, value


def parse_spin_rates(texts: Sequence[str]) -> dict[str, float]:
    """Return the rates [rad/s] of texts ``JOINT=RATE``, by joint.

    Raises:
        UsageError: a text is no such pair, or a joint is named twice.
    """
    rates: dict[str, float] = {}
    for text in texts:
        form = "JOINT=RATE in rad/s, such as spindle_rz=6.28"
        joint, rate = read_assignment("--spin", text, form)
        if joint in rates:
            raise UsageError(f"--spin names {joint!r} twice: give it one rate")
        rates[joint] = rate
    return rates
