r"""Sizes as estimated: how far from the true ones, and whether their intervals hold them.

The error of a scalar is |estimate / truth - 1|, of a vector |estimate - truth| / |truth|. The
*size* of an effect is the parameter that tells how strong it is (``names.CATALOGUE``), and its
error |estimate - truth| / |truth - neutral|: a gain of 1.1 that is estimated as 1 is off by all of
the effect. Neutral is 1 for gain, fraction and factor, 0 for all others; sensor_polarity,
sensor_swap and flexible_body have no size.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from truth.grade.answer import TrueCause, Truth
from truth.grade.rates import Rate, quantile, rate_of
from truth.grade.verdict import CATALOGUE, UNEXPLAINED, Numbers, Row, StatedVerdict

_MIN_TRUE_SIZE = 1e-30  # a truth that has no size


@dataclass(frozen=True)
class Estimate:
    """A true parameter, and what a verdict says of it.

    Args:
        effect, parameter: its names.
        is_size: whether it is the effect's size.
        error: relative; None if the verdict has no such number, or the truth is zero.
        size_error: error against the neutral value; None as above, or if it is not the size.
        inside: for each component with an interval, whether that holds the truth.
    """

    effect: str
    parameter: str
    is_size: bool
    error: float | None
    size_error: float | None
    inside: tuple[bool, ...]


@dataclass(frozen=True)
class Errors:
    """Relative errors of a parameter.

    Args:
        true: how often the truth states it.
        n: how often a verdict has the cause at its place, and the number.
        median, ninety: of the errors; None where n is 0.
    """

    true: int
    n: int
    median: float | None
    ninety: float | None


@dataclass(frozen=True)
class Sizes:
    """All of the above.

    Args:
        size: errors of the sizes of all effects.
        size_of: by effect.
        parameters: by effect and parameter.
        intervals: how many components' intervals hold the truth.
        intervals_of: by effect.
    """

    size: Errors
    size_of: dict[str, Errors]
    parameters: dict[str, dict[str, Errors]]
    intervals: Rate
    intervals_of: dict[str, Rate]


def estimates_of(truth: Truth, verdict: StatedVerdict) -> tuple[Estimate, ...]:
    """Return one estimate for each parameter that the truth states of an effect it knows."""
    estimates = []
    for cause in truth.causes:
        if cause.effect == UNEXPLAINED:
            continue
        rows = [
            row
            for row in verdict.causes
            if (row.effect, row.location) == (cause.effect, cause.location)
        ]
        row = rows[0] if rows else None
        estimates += [_estimate(cause, name, row) for name in cause.parameters]
    return tuple(estimates)


def sizes_of(estimates: Iterable[Estimate]) -> Sizes:
    """Return the errors and intervals of many estimates."""
    known = list(estimates)
    sizes = [estimate for estimate in known if estimate.is_size]
    effects = sorted({estimate.effect for estimate in known})
    parameters: dict[str, dict[str, Errors]] = {}
    for effect in effects:
        of_effect = [estimate for estimate in known if estimate.effect == effect]
        names = dict.fromkeys(estimate.parameter for estimate in of_effect)
        parameters[effect] = {
            name: _errors([estimate.error for estimate in of_effect if estimate.parameter == name])
            for name in names
        }
    return Sizes(
        size=_errors([estimate.size_error for estimate in sizes]),
        size_of={
            effect: _errors(
                [estimate.size_error for estimate in sizes if estimate.effect == effect]
            )
            for effect in sorted({estimate.effect for estimate in sizes})
        },
        parameters=parameters,
        intervals=_rate_inside(known),
        intervals_of={
            effect: _rate_inside([estimate for estimate in known if estimate.effect == effect])
            for effect in effects
        },
    )


def _estimate(cause: TrueCause, name: str, row: Row | None) -> Estimate:
    entry, true = CATALOGUE[cause.effect], cause.parameters[name]
    stated = None if row is None else row.parameters.get(name)
    if stated is not None and len(stated) - sum(map(math.isnan, stated)) == len(true) == 1:
        true = true * len(stated)  # the one direction that moves
    if stated is not None and (len(stated) != len(true) or all(map(math.isnan, stated))):
        stated = None
    intervals = row.interval.get(name, ()) if row is not None and stated is not None else ()
    is_size = entry.size == name
    return Estimate(
        effect=cause.effect,
        parameter=name,
        is_size=is_size,
        error=_relative(stated, true, 0.0),
        size_error=_relative(stated, true, entry.neutral) if is_size else None,
        inside=tuple(
            low <= value <= high
            for value, (low, high) in zip(true, intervals, strict=False)
            if not math.isnan(low)
        ),
    )


def _relative(stated: Numbers | None, true: Numbers, neutral: float) -> float | None:
    if stated is None:
        return None
    pairs = [pair for pair in zip(stated, true, strict=True) if not math.isnan(pair[0])]
    whole = math.hypot(*(value - neutral for _, value in pairs))
    if whole < _MIN_TRUE_SIZE:
        return None
    return math.hypot(*(number - value for number, value in pairs)) / whole


def _errors(errors: list[float | None]) -> Errors:
    known = [error for error in errors if error is not None]
    if not known:
        return Errors(len(errors), 0, None, None)
    return Errors(len(errors), len(known), quantile(known, 0.5), quantile(known, 0.9))


def _rate_inside(estimates: list[Estimate]) -> Rate:
    return rate_of(float(is_inside) for estimate in estimates for is_inside in estimate.inside)
