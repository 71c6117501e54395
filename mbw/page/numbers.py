"""Numbers and units as reports write them."""

import math

UNITS = {  # of FRFs along and about an axis
    "accelerance": ("m/s²/N", "rad/s²/N"),
    "mobility": ("m/s/N", "rad/s/N"),
    "receptance": ("m/N", "rad/N"),
}
_SHOWN = {"m": ("mm", 1e3), "rad": ("°", math.degrees(1.0))}


def short(value: float) -> str:
    """Four figures, such as 5.570e9."""
    text = f"{value:#.4g}"
    if "e" not in text:
        return text.rstrip(".")
    mantissa, exponent = text.split("e")
    return f"{mantissa}e{int(exponent)}"


def percent(value: float) -> str:
    """Three figures."""
    return f"{100 * value:.3g} %"


def moved(drawn: float, value: float, unit: str) -> str:
    """How far a value is from the drawn one: in mm or degrees, of sizes in per cent."""
    if unit in _SHOWN:
        name, scale = _SHOWN[unit]
        return f"{scale * (value - drawn):+.3g}{_spaced(name)}"
    return f"{100 * (value / drawn - 1):+.3g} %" if drawn else f"{value:+.3g} {unit}"


def tolerance(prior: float, unit: str) -> str:
    """A standard deviation of the drawing: in mm or degrees, of sizes in per cent."""
    name, scale = _SHOWN.get(unit, ("%", 100.0))
    return f"{scale * prior:.3g}{_spaced(name)}"


def _spaced(unit: str) -> str:
    return unit if unit == "°" else f" {unit}"
