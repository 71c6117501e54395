"""Parameters of an effect in the units that engineers read, with as many digits as are known."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from diagnosis.hypothesis import Ends, Value
from mbw.page.numbers import short

_LARGE, _SMALL = 1e5, 1e-3  # beyond, numbers have an exponent
_RATIO = ("appendage", "flexible_body", "mount_resonance")  # whose damping is a ratio
_PLAIN = {  # factor from SI, unit
    "mass": (1.0, "kg"),
    "frequency": (1.0, "Hz"),
    "position": (1e3, "mm"),
    "offset": (1e3, "mm"),
    "rotation": (math.degrees(1.0), "°"),
    "angular_momentum": (1.0, "kg m²/s"),
    "tau": (1e3, "ms"),
    "delay": (1e3, "ms"),
    "fraction": (100.0, "%"),
    "limit": (1.0, "N"),
}
_ALONG = {"stiffness": "N/m", "damping": "N s/m", "k": "N/m", "gap": "m", "k3": "N/m³"}
_ABOUT = {
    "stiffness": "N m/rad",
    "damping": "N m s/rad",
    "k": "N m/rad",
    "limit": "N m",
    "gap": "rad",
    "k3": "N m/rad³",
}


@dataclass(frozen=True)
class Line:
    """One number of a parameter, to be read.

    Args:
        name: with the axis of a vector.
        value: with its unit.
        interval: both ends, 95 %; empty if there is none.
    """

    name: str
    value: str
    interval: str


def parameter_lines(
    effect: str, dof: str | None, name: str, value: Value, ends: Ends | None
) -> list[Line]:
    """One line, or one for each component of a vector.

    Args:
        effect: of the catalogue.
        dof: its direction.
        name: of the parameter in the verdict.
        value: in SI.
        ends: of its interval, of a vector those of each component; None if there is none.
    """
    factor, unit = unit_of(effect, dof, name)
    values = list(value) if isinstance(value, tuple) else [value]
    names = [name]
    if isinstance(value, tuple):
        axes = "xyz" if len(value) == 3 else [str(k) for k in range(1, len(value) + 1)]
        names = [f"{name} {axis}" for axis in axes]
    pairs = [None] * len(values) if ends is None else np.reshape(ends, (len(values), 2)).tolist()
    return [
        _line(one.replace("_", " "), factor * of, pair and [factor * end for end in pair], unit)
        for one, of, pair in zip(names, values, pairs, strict=True)
    ]


def parameter_words(effect: str, dof: str | None, name: str, value: Value) -> str:
    """``mass 57.9 kg``, ``offset (-122, -120, -73) mm``."""
    factor, unit = unit_of(effect, dof, name)
    numbers = value if isinstance(value, tuple) else (value,)
    said = [number(factor * one) for one in numbers]
    text = f"({', '.join(said)})" if isinstance(value, tuple) else said[0]
    return f"{name.replace('_', ' ')} {text}{_spaced(unit)}"


def may_be_nothing(interval: Mapping[str, Ends]) -> frozenset[str]:
    """Sizes whose interval includes zero: what goes with them, as a place, is not known then."""
    rows = {name: np.asarray(ends) for name, ends in interval.items()}
    return frozenset(name for name, row in rows.items() if row.ndim == 1 and row[0] < 0 < row[1])


def interval_words(effect: str, dof: str | None, name: str, ends: tuple[float, float]) -> str:
    """``mass -0.3 … 0.8 kg``, of a size that may be nothing."""
    factor, unit = unit_of(effect, dof, name)
    half = factor * (ends[1] - ends[0]) / 2
    low, high = (number(factor * end, half) for end in ends)
    return f"{name.replace('_', ' ')} {low} … {high}{_spaced(unit)}"


def unit_of(effect: str, dof: str | None, name: str) -> tuple[float, str]:
    """What a number in SI is multiplied by to be read, and its unit then."""
    if name == "damping" and effect in _RATIO:
        return 100.0, "%"
    turning = dof is not None and dof[:1] == "r" and name in _ABOUT
    if turning or name in _ALONG:
        return 1.0, (_ABOUT if turning else _ALONG)[name]
    return _PLAIN.get(name, (1.0, ""))


def number(value: float, half: float | None = None) -> str:
    """Three figures, or as many as half an interval leaves two of itself.

    Args:
        value: to be written.
        half: half of its interval.
    """
    if value and not _SMALL <= abs(value) < _LARGE:
        return short(value) if half is not None else f"{value:.3g}"
    if half is None or not half > 0:
        return f"{float(f'{value:.3g}'):g}"
    decimals = min(max(1 - math.floor(math.log10(half)), 0), 5)
    return f"{value:.{decimals}f}"


def _line(name: str, value: float, pair: list[float] | None, unit: str) -> Line:
    if pair is None:
        return Line(name, f"{number(value)}{_spaced(unit)}", "")
    half = (pair[1] - pair[0]) / 2
    low, high = (number(end, half) for end in pair)
    return Line(name, f"{number(value, half)}{_spaced(unit)}", f"{low} … {high}")


def _spaced(unit: str) -> str:
    return unit if unit in ("", "°") else f" {unit}"
