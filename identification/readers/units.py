"""Units of motion and force, as universal files label them and campaign.toml states them."""

from pathlib import Path

from identification.words import InputError, Quantity

STANDARD_GRAVITY = 9.80665  # m/s^2 in one g
_SI_MOTION_UNITS: dict[Quantity, str] = {
    "receptance": "m",
    "mobility": "m/s",
    "accelerance": "m/s^2",
}
_LENGTH_PREFIXES = {"": 1.0, "m": 1e-3, "u": 1e-6, "n": 1e-9}
_LENGTHS_M = {
    **{f"{prefix}m": factor for prefix, factor in _LENGTH_PREFIXES.items()},
    **{"cm": 1e-2, "in": 0.0254, "inch": 0.0254, "ft": 0.3048},
}
_FORCES_N = {
    **{"N": 1.0, "mN": 1e-3, "kN": 1e3, "MN": 1e6, "Newton": 1.0, "newton": 1.0},
    **{"lbf": 4.4482216152605, "lb": 4.4482216152605, "kgf": STANDARD_GRAVITY},
}
_SPELLINGS = (("²", "^2"), ("**", "^"), ("sec", "s"), ("s2", "s^2"), ("µ", "u"), ("μ", "u"))


def motion_label_factor(label: str, quantity: Quantity) -> float | None:
    """Return the factor that converts a labelled motion to SI units; None for an unknown label.

    Args:
        label: unit of the motion, such as ``g`` or ``mm/s^2``.
        quantity: quantity of the FRF that has this motion.
    """
    text = _plain_label(label)
    if quantity == "accelerance" and text.lower() in ("g", "gn", "g's", "gs"):
        return STANDARD_GRAVITY
    time = _SI_MOTION_UNITS[quantity].removeprefix("m")
    for unit, factor in _LENGTHS_M.items():
        if text.lower() == f"{unit}{time}":
            return factor
    return None


def force_label_factor(label: str) -> float | None:
    """Return the factor that converts a labelled force to newtons; None for an unknown label."""
    return _FORCES_N.get(_plain_label(label))


def is_gravity_label(label: str, quantity: Quantity) -> bool:
    """Return whether a label gives an acceleration in units of standard gravity."""
    return motion_label_factor(label, quantity) == STANDARD_GRAVITY


def unit_factor(path: Path, quantity: Quantity, unit: str | None) -> float:
    """Return the factor that converts FRFs from a unit to SI.

    Args:
        path: the file, for messages.
        quantity: quantity of the FRFs.
        unit: unit such as ``g/N``; None for SI.

    Raises:
        InputError: the unit does not belong to the quantity.
    """
    motion = _SI_MOTION_UNITS[quantity]
    if unit is None:
        return 1.0
    units = {f"{prefix}{motion}/N": factor for prefix, factor in _LENGTH_PREFIXES.items()}
    if quantity == "accelerance":
        units["g/N"] = STANDARD_GRAVITY
    if unit not in units:
        raise InputError(
            f"{path}: unit {unit!r} is not a unit of {quantity}: write one of {', '.join(units)}"
        )
    return units[unit]


def _plain_label(label: str) -> str:
    """Return a label without brackets and spaces, in one spelling."""
    text = label.strip().strip("[]()").replace(" ", "")
    for spelling, plain in _SPELLINGS:
        if plain not in text:
            text = text.replace(spelling, plain)
    return text
