"""Mass that a user states on the command line, with its tolerance: ``800``, ``800+-40``."""

import re

import numpy as np

from identification.words import InputError, UsageError

_DEFAULT_TOLERANCE_PERCENT = 5.0  # of the mass, where none is stated: joints, glue, cables
_MASS_TEXT = re.compile(r"\s*(\S+?)\s*(?:(?:\+-|\+/-|\u00b1)\s*(\S+?)\s*(%?))?\s*(?:kg)?\s*")


def read_mass(text: str) -> tuple[float, float]:
    """Return mass and tolerance [kg] of a text such as ``800``, ``800+-40`` or ``800+-5%``.

    Raises:
        UsageError: the text has another form.
        InputError: the mass is not positive, or the tolerance negative.
    """
    match = _MASS_TEXT.fullmatch(text)
    try:
        if match is None:
            raise ValueError
        mass = float(match[1])
        width = _DEFAULT_TOLERANCE_PERCENT if match[2] is None else float(match[2])
    except ValueError:
        raise UsageError(
            f"--mass {text!r} is no mass: give kg with or without a tolerance, as 800 or 800+-40"
        ) from None
    is_relative = match[2] is None or match[3]
    tolerance = width * mass / 100 if is_relative else width
    if not 0 < mass < np.inf:
        raise InputError(f"--mass {text} is no mass: give the mass of the structure in kg")
    if not 0 <= tolerance < np.inf:
        raise InputError(f"--mass {text}: give a tolerance of 0 or more, as 800+-40")
    return mass, tolerance
