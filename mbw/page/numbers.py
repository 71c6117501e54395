"""Numbers and units as text, as pages write them."""

import math

from identification.words import split_label

MOTION_UNITS = {  # along and about an axis
    "accelerance": ("m/s²", "rad/s²"),
    "mobility": ("m/s", "rad/s"),
    "receptance": ("m", "rad"),
}
# Name and factor from SI.
_DISPLAY_UNITS = {"m": ("mm", 1e3), "rad": ("°", math.degrees(1.0)), "s": ("µs", 1e6)}


def motion_unit(quantity: str, output: str) -> str:
    """Return the unit of the motion at an output.

    Args:
        output: label such as ``acc1:+rz``.
    """
    if not split_label(output)[1]:
        return "reading"
    return MOTION_UNITS[quantity][_is_rotation(output)]


def force_unit(reference: str) -> str:
    """Return the unit of what drives a test: a force, a torque, or the control of a motor.

    Args:
        reference: label such as ``acc1:+rz``, or name of a motor, which has no colon.
    """
    if not split_label(reference)[1]:
        return "control"
    return "(N m)" if _is_rotation(reference) else "N"


def frf_unit(quantity: str, output: str, reference: str) -> str:
    """Return the unit of an FRF, such as ``rad/s²/(N m)``.

    Args:
        output: label of its output.
        reference: label of its input, or name of a motor.
    """
    return f"{motion_unit(quantity, output)}/{force_unit(reference)}"


def _is_rotation(label: str) -> bool:
    """Return whether a label ``point:direction`` means a rotation or torque."""
    return split_label(label)[1].startswith("r")


def format_four_digits(value: float) -> str:
    """Return a number with four significant digits, such as ``5.570e9``."""
    text = f"{value:#.4g}"
    if "e" not in text:
        return text.rstrip(".")
    mantissa, exponent = text.split("e")
    return f"{mantissa}e{int(exponent)}"


def format_digits(value: float, digits: int) -> str:
    """Return a number with some significant digits and no exponent, such as ``120``."""
    return f"{float(f'{value:.{digits}g}'):.15g}"


def format_percent(value: float, digits: int = 3) -> str:
    """Return a ratio in per cent, with three significant digits by default."""
    return f"{format_digits(100 * value, digits)} %"


def format_closed(share: float, digits: int = 3) -> str:
    """Return the share of a gap that causes close, such as ``87 %``, ``about all`` or ``none``.

    A share beyond 0 to 100 % is none: beyond 100 % the residual falls below the estimated noise,
    and below 0 the gap grows.
    """
    if share < 0:
        return "none"
    text = format_percent(share, digits)
    is_beyond_all = share > 1 and text != format_percent(1.0, digits)
    return "about all" if is_beyond_all else text


def format_shift(drawn: float, value: float, unit: str) -> str:
    """Return the shift of a value from its nominal one.

    Lengths, angles and delays are in mm, degrees and µs; all else is relative, in per cent.
    """
    if unit in _DISPLAY_UNITS:
        name, scale = _DISPLAY_UNITS[unit]
        return f"{scale * (value - drawn):+.3g}{_with_space(name)}"
    if unit == "1" and not drawn:
        return f"{100 * value:+.3g} %"
    return f"{100 * (value / drawn - 1):+.3g} %" if drawn else f"{value:+.3g} {unit}"


def format_tolerance(prior: float, unit: str) -> str:
    """Return a prior standard deviation: in mm, degrees or µs, else in per cent."""
    name, scale = _DISPLAY_UNITS.get(unit, ("%", 100.0))
    return f"{scale * prior:.3g}{_with_space(name)}"


def _with_space(unit: str) -> str:
    return unit if unit == "°" else f" {unit}"
