"""Parameters of an effect as text, in engineering units and with the digits that are known."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from diagnosis.stated_values import DAMPING_RATIO_EFFECTS, Ends, Value, list_pairs, may_be_zero
from mbw.page.numbers import format_four_digits

_EXPONENT_FROM, _EXPONENT_BELOW = 1e5, 1e-3  # sizes beyond which numbers have an exponent
NOT_SEEN = "not seen"  # a component that no motion of the machine shows
_PARAMETER_UNITS = {  # factor from SI, unit
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
    "preload": (1.0, "N"),
}
_FRAMES = {  # of vectors, by effect and parameter
    ("mass_error", "position"): "from the body's centre of mass as drawn, in world axes",
    ("appendage", "position"): "from the body's centre of mass as drawn, in world axes",
    ("parallel_path", "stiffness"): "along the world axes",
    ("parallel_path", "damping"): "along the world axes",
    ("parallel_path", "position"): "in world axes",
    ("joint_coupling", "offset"): "from the joint as drawn, in world axes",
    ("sensor_position", "offset"): "from the place as drawn, in world axes",
    ("hammer_position", "offset"): "from the place as drawn, in world axes",
    ("sensor_misalignment", "rotation"): "as a vector in world axes",
    ("hammer_misalignment", "rotation"): "as a vector in world axes",
}
_TRANSLATION_UNITS = {
    "stiffness": "N/m",
    "damping": "N s/m",
    "inertance": "kg",
    "k": "N/m",
    "gap": "m",
    "k3": "N/m³",
}
_ROTATION_UNITS = {
    "stiffness": "N m/rad",
    "damping": "N m s/rad",
    "inertance": "kg m²",
    "k": "N m/rad",
    "limit": "N m",
    "preload": "N m",
    "gap": "rad",
    "k3": "N m/rad³",
}


@dataclass(frozen=True)
class ParameterText:
    """One number of a parameter as text.

    Args:
        name: name of the parameter, with the axis if it is a vector.
        value: value with its unit.
        interval: both ends of the 95 % interval; empty if there is none.
    """

    name: str
    value: str
    interval: str


def parameter_lines(
    effect: str, dof: str | None, name: str, value: Value, ends: Ends | None
) -> list[ParameterText]:
    """Return the text of a number, or one text for each component of a vector.

    Args:
        effect: name of the effect in the catalogue.
        dof: direction of the effect.
        name: name of the parameter in the verdict.
        value: value in SI units.
        ends: ends of its interval, for a vector those of each component; None if there is none.
    """
    factor, unit = unit_of(effect, dof, name)
    values = list(value) if isinstance(value, tuple) else [value]
    if not any(component is not None for component in values):
        return [ParameterText(name.replace("_", " "), NOT_SEEN, "")]
    factored = [None if component is None else factor * component for component in values]
    names = [name]
    if isinstance(value, tuple):
        axes = "xyz" if len(value) == 3 else [str(k) for k in range(1, len(value) + 1)]
        names = [f"{name} {axis}" for axis in axes]
    pairs = [None] * len(values) if ends is None else list_pairs(ends)
    return [
        _parameter_text(
            label.replace("_", " "), component, pair and [factor * end for end in pair], unit
        )
        for label, component, pair in zip(names, factored, pairs, strict=True)
    ]


def parameter_words(effect: str, dof: str | None, name: str, value: Value) -> str:
    """Return a parameter as text: ``mass 57.9 kg``, ``offset (-122, -120, -73) mm``."""
    factor, unit = unit_of(effect, dof, name)
    components = value if isinstance(value, tuple) else (value,)
    if all(component is None for component in components):
        return f"{name.replace('_', ' ')} {NOT_SEEN}"
    numbers = [
        NOT_SEEN if component is None else number(factor * component) for component in components
    ]
    text = f"({', '.join(numbers)})" if isinstance(value, tuple) else numbers[0]
    frame = f" {words}" if isinstance(value, tuple) and (words := frame_words(effect, name)) else ""
    return f"{name.replace('_', ' ')} {text}{_with_leading_space(unit)}{frame}"


def frame_words(effect: str, name: str) -> str:
    """Return from where and in which axes a vector is stated; empty for a number."""
    return _FRAMES.get((effect, name), "")


def parameters_that_may_be_zero(interval: Mapping[str, Ends]) -> frozenset[str]:
    """Return the scalar parameters whose interval includes zero."""
    return frozenset(
        name
        for name, ends in interval.items()
        if isinstance(ends[0], int | float) and may_be_zero(ends)
    )


def depends_on_doubtful_size(
    name: str, parameters: Mapping[str, Value], interval: Mapping[str, Ends]
) -> bool:
    """Return whether a parameter rests on the effect's size, its first one, which may be zero.

    A mass of zero has no position, but a link whose damping may be zero has a stiffness.
    """
    size = next(iter(parameters))
    return name != size and size in interval and may_be_zero(interval[size])


def interval_words(effect: str, dof: str | None, name: str, ends: tuple[float, float]) -> str:
    """Return the interval of a parameter in the unit of its text: ``-0.3 … 0.8``."""
    factor, _ = unit_of(effect, dof, name)
    half = factor * (ends[1] - ends[0]) / 2
    low, high = (number(factor * end, half) for end in ends)
    return f"{low} … {high}"


def unit_of(effect: str, dof: str | None, name: str) -> tuple[float, str]:
    """Return the factor from SI to the unit of the text, and that unit."""
    if name == "damping" and effect in DAMPING_RATIO_EFFECTS:
        return 100.0, "%"
    is_rotation = dof is not None and dof[:1] == "r" and name in _ROTATION_UNITS
    if is_rotation or name in _TRANSLATION_UNITS:
        return 1.0, (_ROTATION_UNITS if is_rotation else _TRANSLATION_UNITS)[name]
    return _PARAMETER_UNITS.get(name, (1.0, ""))


def number(value: float, half: float | None = None) -> str:
    """Return a number as text, with three digits or with those that its interval justifies.

    The last digit is the second one of half the interval.

    Args:
        value: the number.
        half: half the width of its interval; None if there is none.
    """
    if value and not _EXPONENT_BELOW <= abs(value) < _EXPONENT_FROM:
        return format_four_digits(value) if half is not None else f"{value:.3g}"
    if half is None or not half > 0:
        return f"{float(f'{value:.3g}'):g}"
    decimals = min(max(1 - math.floor(math.log10(half)), 0), 5)
    return f"{value:.{decimals}f}"


def _parameter_text(
    name: str, value: float | None, pair: list[float] | None, unit: str
) -> ParameterText:
    if value is None:
        return ParameterText(name, NOT_SEEN, "")
    if pair is None:
        return ParameterText(name, f"{number(value)}{_with_leading_space(unit)}", "")
    half = (pair[1] - pair[0]) / 2
    low, high = (number(end, half) for end in pair)
    text = f"{number(value, half)}{_with_leading_space(unit)}"
    return ParameterText(name, text, f"{low} … {high}")


def _with_leading_space(unit: str) -> str:
    return unit if unit in ("", "°") else f" {unit}"
