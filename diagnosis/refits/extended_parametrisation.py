"""Parametrisation of a session with hypotheses: releases, ties, bounds and priors."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from diagnosis.hypothesis import Hypothesis
from identification.words import Real
from mbmodel import Model
from tuning import Parametrisation, Session, parametrise

_Value = TypeVar("_Value", str, float)


def extend_parametrisation(
    varies: Parametrisation, model: Model, session: Session, hypotheses: Sequence[Hypothesis]
) -> Parametrisation:
    """Return the coordinates that vary under some hypotheses.

    Args:
        varies: coordinates without the hypotheses.
        model: model with their Parts.
        session: session with the tolerances.
    """
    extended = (
        varies.extend(parametrise(model, session.campaign.tolerance))
        if any(each.parts for each in hypotheses)
        else varies
    )
    free = (
        extended.tie_parameters(merge_values(each.follow for each in hypotheses))
        .release_priors(tuple(name for each in hypotheses for name in each.release))
        .vary_linearly(tuple(name for each in hypotheses for name in each.linear))
    )
    fixed, begin = free.fixed.copy(), merge_values(each.begin for each in hypotheses)
    for k, parameter in enumerate(free.parameters):
        # A parameter that a user has fixed stays at the value that the data checks prove.
        if parameter.name in begin and free.coordinate_of[k] < 0:
            fixed[k] = begin[parameter.name]
    lower, upper = free.lower.copy(), free.upper.copy()
    scale, is_tolerance = free.scale.copy(), free.is_tolerance.copy()
    precision = free.precision.copy()
    for hypothesis in hypotheses:
        if hypothesis.signed:
            sizes = np.isin(np.array(free.names), hypothesis.coordinates)
            lower = np.where(sizes, 0.0, lower)
        for k, name in enumerate(free.names):
            if name in hypothesis.bounds:
                ends = hypothesis.bounds[name]
                lower[k], upper[k] = (
                    _find_ends(free, k, ends) if name in hypothesis.release else ends
                )
            if name in hypothesis.believed:
                deviation = hypothesis.believed[name]
                scale[free.coordinate_of == k] = deviation
                is_tolerance[k], precision[k] = True, 1.0
                lower[k], upper[k] = lower[k] / deviation, upper[k] / deviation
    whole = replace(
        free,
        fixed=fixed,
        lower=lower,
        upper=upper,
        scale=scale,
        is_tolerance=is_tolerance,
        precision=precision,
    )
    held = {
        name: hypothesis.bounds[name][0] for hypothesis in hypotheses for name in hypothesis.held
    }
    if not held:
        return whole
    values = np.array([held.get(parameter.name, 0.0) for parameter in whole.parameters])
    return hold_parameters(whole, values, tuple(held))


def merge_values(values: Iterable[Mapping[str, _Value]]) -> dict[str, _Value]:
    """Return what several hypotheses say of parameters, by their names."""
    return {name: value for each in values for name, value in each.items()}


def _find_ends(
    varies: Parametrisation, coordinate: int, ends: tuple[float, float]
) -> tuple[float, float]:
    """Return bounds of a coordinate from those of its parameter [SI]."""
    member = varies.coordinate_of == coordinate
    low, high = (
        float(varies.coordinates(np.where(member, end, varies.fixed))[coordinate]) for end in ends
    )
    return low, high


def hold_parameters(varies: Parametrisation, theta: Real, names: Sequence[str]) -> Parametrisation:
    """Return a parametrisation in which some parameters stay at theta; those tied to them vary.

    Args:
        varies: coordinates that vary.
        theta: values [SI]; (n_parameter,).
        names: names of the parameters that stay.
    """
    is_held = np.isin([parameter.name for parameter in varies.parameters], list(names))
    member = np.where(is_held, -1, varies.coordinate_of)
    kept = np.isin(np.arange(varies.size), member)
    number = np.append(np.where(kept, np.cumsum(kept) - 1, -1), -1)
    return replace(
        varies,
        coordinate_of=number[member],
        fixed=np.where(is_held, theta, varies.fixed),
        is_tolerance=varies.is_tolerance[kept],
        precision=varies.precision[kept],
        lower=varies.lower[kept],
        upper=varies.upper[kept],
    )
