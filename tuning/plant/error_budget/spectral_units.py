"""Units of spectral densities, such as ``(m/s^2)^2/Hz`` or ``nm/sqrt(Hz)``."""

import re
from dataclasses import dataclass
from typing import Literal

Kind = Literal["length", "angle", "force", "torque", "electrical", "control"]

STANDARD_GRAVITY = 9.80665  # m/s^2
_PREFIXES = {"": 1.0, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "k": 1e3}
# Kind and number of time derivatives of the units that may carry a prefix.
_BASE_UNITS: dict[str, tuple[Kind, int, float]] = {
    "m": ("length", 0, 1.0),
    "m/s": ("length", 1, 1.0),
    "m/s^2": ("length", 2, 1.0),
    "g": ("length", 2, STANDARD_GRAVITY),
    "rad": ("angle", 0, 1.0),
    "rad/s": ("angle", 1, 1.0),
    "rad/s^2": ("angle", 2, 1.0),
    "N": ("force", 0, 1.0),
    "Nm": ("torque", 0, 1.0),
    "V": ("electrical", 0, 1.0),
    "A": ("electrical", 0, 1.0),
    "counts": ("electrical", 0, 1.0),
    "1": ("control", 0, 1.0),
}
_ROOT_OF_HZ = r"/(?:sqrt\(Hz\)|rtHz|√Hz|√\(Hz\)|Hz\^0\.5|Hz\^\(1/2\))"
_EXAMPLES = "write for example (m/s^2)^2/Hz, g^2/Hz, N^2/Hz or nm/sqrt(Hz)"


@dataclass(frozen=True)
class SignalUnit:
    """Unit of a signal.

    Args:
        kind: what the signal is.
        derivative: number of time derivatives of a length or angle.
        factor: SI value of one unit; controls have no SI unit and the factor 1.
    """

    kind: Kind
    derivative: int
    factor: float


@dataclass(frozen=True)
class DensityUnit:
    """Unit of a spectral density.

    Args:
        signal: unit of the signal.
        is_root: whether values are roots of a power density, per root of Hz.
    """

    signal: SignalUnit
    is_root: bool


def fits(stated: Kind, signal: Kind) -> bool:
    """Return whether a stated unit may be that of a signal: of its kind, or V of an unknown one."""
    return stated == signal or (stated, signal) == ("electrical", "control")


def parse_signal_unit(text: str) -> SignalUnit:
    """Return the unit that a text such as ``nm`` or ``mm/s^2`` means.

    Raises:
        ValueError: the text is no unit.
    """
    plain = re.sub(r"[\s*·()]", "", text).replace("²", "^2").replace("s2", "s^2")
    for base, (kind, derivative, size) in _BASE_UNITS.items():
        prefix = plain.removesuffix(base)
        is_prefix = prefix in _PREFIXES and not (prefix and base == "1")
        if plain.endswith(base) and is_prefix and plain != "kg":
            return SignalUnit(kind, derivative, _PREFIXES[prefix] * size)
    raise ValueError(f"{text!r} is no unit of a signal: write for example nm, m/s^2, N or V")


def parse_density_unit(text: str) -> DensityUnit:
    """Return the unit that a text such as ``(m/s^2)^2/Hz`` or ``nm/sqrt(Hz)`` means.

    Raises:
        ValueError: the text is no unit of a spectral density.
    """
    plain = re.sub(r"\s", "", text).replace("²", "^2")
    root = re.fullmatch(rf"(.+){_ROOT_OF_HZ}", plain)
    power = re.fullmatch(r"(?:\((.+)\)|([^()]+))\^2/Hz", plain)
    product = re.fullmatch(r"(.*m)\^2/s\^(2|4)/Hz", plain)
    if product:
        signal = f"{product[1]}/s" + ("^2" if product[2] == "4" else "")
    elif power:
        signal = power[1] or power[2]
    elif root:
        signal = root[1]
    else:
        raise ValueError(f"{text!r} is no unit of a spectral density: {_EXAMPLES}")
    try:
        return DensityUnit(parse_signal_unit(signal), is_root=bool(root) and not power)
    except ValueError as error:
        raise ValueError(f"{text!r} is no unit of a spectral density: {_EXAMPLES}") from error
