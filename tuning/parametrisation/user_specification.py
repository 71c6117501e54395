"""What varies: what the drawing does not know exactly, and what a user wishes of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from fnmatch import fnmatchcase

import numpy as np

from identification.words import InputError, Mask, Real, Tolerance
from mbmodel import Model, Parameter
from tuning.parametrisation.parametrisation import BOUND, Freedom

_RELATIVE = ("mass", "inertia", "sensor_gain")
_RANGE = float(np.log(100.0))


@dataclass(frozen=True)
class Wishes:
    """What a user says of parameters, by name or pattern (``*``, ``?``): ``[tuning]``.

    Args:
        free: tuned outright, without a prior.
        fix: kept as drawn.
        prior: one standard deviation about the drawing; relative of sizes, else in SI.
        bounds: lowest and highest value in SI.
        ties: groups that share one factor on their drawn values, or one displacement.
    """

    free: Sequence[str] = ()
    fix: Sequence[str] = ()
    prior: Mapping[str, float] = field(default_factory=dict)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    ties: Sequence[Sequence[str]] = ()


def freedom(model: Model, tolerance: Tolerance, wishes: Wishes | None = None) -> Freedom:
    """What varies by default, and what a user wishes.

    Args:
        model: machine and Parts.
        tolerance: one standard deviation of what the drawings say; zero means exactly.
        wishes: of a user.

    Raises:
        InputError: a pattern that fits no parameter, wishes that contradict each other.
    """
    wishes = wishes or Wishes()
    names = [parameter.name for parameter in model.parameters]
    spread = np.array([_spread(one, tolerance) for one in model.parameters])
    for pattern, deviation in wishes.prior.items():
        if not deviation > 0:
            raise InputError(f"[tuning] prior of {pattern} is {deviation:g}: give more than 0")
        spread[matching(pattern, names)] = deviation
    free, fixed, given = (
        _any(patterns, names) for patterns in (wishes.free, wishes.fix, list(wishes.prior))
    )
    both = free.astype(int) + fixed + given > 1
    if both.any():
        raise InputError(
            f"[tuning] {names[int(np.argmax(both))]} stands under two of free, fix and prior: "
            "choose one"
        )
    spread[free] = np.inf
    spread[fixed] = 0.0
    varies = spread > 0
    known = np.isfinite(spread)
    member = np.where(varies, np.cumsum(varies) - 1, -1)
    lower, upper = _bounds(model, spread, wishes, names)
    made = Freedom(
        model.parameters,
        member=member,
        scale=np.where(varies & known, spread, 1.0),
        fixed=model.drawn,
        has_prior=known[varies],
        lower=lower[varies],
        upper=upper[varies],
    )
    return _tied(made, wishes.ties, names)


def _spread(parameter: Parameter, tolerance: Tolerance) -> float:
    """Standard deviation of x's scale: infinite if free, zero if known exactly."""
    if parameter.known == "free":
        return np.inf
    if parameter.known == "exactly":
        return 0.0
    spread = float(getattr(tolerance, parameter.known))
    relative = parameter.known in _RELATIVE and not parameter.positive
    return spread * abs(parameter.drawn) if relative else spread


def _bounds(model: Model, spread: Real, wishes: Wishes, names: list[str]) -> tuple[Real, Real]:
    """Bounds of x for each parameter."""
    positive = np.array([parameter.positive for parameter in model.parameters], bool)
    widest = np.where(np.isfinite(spread), BOUND, np.where(positive, _RANGE, np.inf))
    lower, upper = -widest, widest.copy()
    for pattern, (low, high) in wishes.bounds.items():
        for place in matching(pattern, names):
            drawn, scale = model.drawn[place], spread[place] if np.isfinite(spread[place]) else 1.0
            if not low < high or (positive[place] and low <= 0) or not low <= drawn <= high:
                raise InputError(
                    f"[tuning] bounds of {names[place]} are {low:g} .. {high:g}: give a lower and "
                    f"a higher value about the drawn one, {drawn:g}"
                )
            if scale > 0:
                ends = np.array([low, high])
                x = (np.log(ends / drawn) if positive[place] else ends - drawn) / scale
                lower[place], upper[place] = x
    return lower, upper


def _tied(made: Freedom, ties: Sequence[Sequence[str]], names: list[str]) -> Freedom:
    """Give the parameters of each tie one coordinate."""
    member = made.member.copy()
    for patterns in ties:
        places = np.flatnonzero(_any(patterns, names))
        found = sorted({int(member[place]) for place in places})
        kinds = {
            (
                made.parameters[k].positive,
                made.parameters[k].unit,
                float(made.scale[k]),
                bool(np.append(made.has_prior, False)[member[k]]),
            )
            for k in places
        }
        if not found or found[0] < 0 or len(kinds) > 1:
            raise InputError(
                f"[tuning] {', '.join(names[k] for k in places)} cannot be tied: name parameters "
                "of one unit and one prior that vary"
            )
        member[np.isin(member, found[1:])] = found[0]
    kept = np.unique(member[member >= 0])
    lower, upper = (
        np.array([combine(values[made.member[member == k]]) for k in kept])
        for values, combine in ((made.lower, np.max), (made.upper, np.min))
    )
    number = np.full(made.size + 1, -1)
    number[kept] = np.arange(len(kept))
    return replace(
        made,
        member=number[member],
        has_prior=made.has_prior[kept],
        lower=lower.reshape(-1),
        upper=upper.reshape(-1),
    )


def _any(patterns: Sequence[str], names: list[str]) -> Mask:
    chosen = np.zeros(len(names), bool)
    for pattern in patterns:
        chosen[matching(pattern, names)] = True
    return chosen


def matching(pattern: str, names: list[str]) -> list[int]:
    """Numbers of the names that a pattern fits.

    Raises:
        InputError: none, with the nearest name.
    """
    found = [k for k, name in enumerate(names) if name == pattern or fnmatchcase(name, pattern)]
    if not found:
        near = get_close_matches(pattern, names, 1, 0.0)
        raise InputError(
            f"[tuning] {pattern!r} fits no parameter: did you mean {near[0] if near else 'none'}?"
        )
    return found
