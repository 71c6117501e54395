"""Choice of the parameters that vary: tolerances by default, and what a user specifies."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from fnmatch import fnmatchcase

import numpy as np

from identification.words import TOLERANCE_BOUND_SIGMA, InputError, Mask, Real, Tolerance
from mbmodel import Model, Parameter
from tuning.parametrisation.parametrisation import Parametrisation

_RELATIVE_TOLERANCES = (
    "mass",
    "inertia",
    "sensor_gain",
    "hammer_gain",
)  # fractions of the nominal value
_FACTORS = ("stiffness", "damping")  # whose standard deviation is a factor on the nominal value
# Standard deviation of ln of an unknown gain about its nominal value, which a nominal model with
# stiffness and masses off by a factor of 2 still gives: wide enough to add no information.
UNKNOWN_GAIN_SD = 1.0
FREE_RANGE_LOG = float(np.log(100.0))  # bound of a size without a tolerance: a factor of 100


@dataclass(frozen=True)
class UserSpecification:
    """User specification of parameters, from ``[tuning]`` of campaign.toml.

    Parameters are given by name or by pattern (``*``, ``?``).

    Args:
        free: parameters that vary without a prior.
        fix: parameters that keep their nominal value.
        prior: standard deviation about the nominal value; relative for sizes, else in SI units.
        bounds: lowest and highest value [SI].
        ties: groups of parameters that share one factor on their nominal values (sizes) or one
            displacement.
    """

    free: Sequence[str] = ()
    fix: Sequence[str] = ()
    prior: Mapping[str, float] = field(default_factory=dict)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    ties: Sequence[Sequence[str]] = ()


def fitting_specification(specification: UserSpecification, names: list[str]) -> UserSpecification:
    """Return the part of a specification that names some parameters.

    Args:
        specification: of another test of the same machine, with other sensors.
    """

    def fits(pattern: str) -> bool:
        return any(fnmatchcase(name, pattern) for name in names)

    return UserSpecification(
        free=[pattern for pattern in specification.free if fits(pattern)],
        fix=[pattern for pattern in specification.fix if fits(pattern)],
        prior={name: value for name, value in specification.prior.items() if fits(name)},
        bounds={name: value for name, value in specification.bounds.items() if fits(name)},
        ties=[group for group in specification.ties if all(map(fits, group))],
    )


def parametrise(
    model: Model, tolerance: Tolerance, specification: UserSpecification | None = None
) -> Parametrisation:
    """Return the parametrisation of a model: its default, changed by what a user specifies.

    Args:
        tolerance: standard deviations of what the drawings state; zero means known exactly.
        specification: what a user specifies.

    Raises:
        InputError: a pattern that fits no parameter, or entries that contradict each other.
    """
    specification = specification or UserSpecification()
    names = [parameter.name for parameter in model.parameters]
    prior_sd = np.array([_prior_sd(parameter, tolerance) for parameter in model.parameters])
    for pattern, deviation in specification.prior.items():
        if not deviation > 0:
            raise InputError(f"[tuning] prior of {pattern} is {deviation:g}: give more than 0")
        prior_sd[match_pattern(pattern, names)] = deviation
    free, fixed, with_prior = (
        _match_any(patterns, names)
        for patterns in (specification.free, specification.fix, list(specification.prior))
    )
    conflicting = free.astype(int) + fixed + with_prior > 1
    if conflicting.any():
        raise InputError(
            f"[tuning] {names[int(np.argmax(conflicting))]} stands under two of free, fix and "
            "prior: choose one"
        )
    prior_sd[free] = np.inf
    prior_sd[fixed] = 0.0
    varied = prior_sd > 0
    is_tolerance = np.isfinite(prior_sd)
    usual = np.array([parameter.usual for parameter in model.parameters])
    width = np.array([_prior_width(parameter, tolerance) for parameter in model.parameters])
    precision = np.where(is_tolerance, 1.0, np.where(free, 0.0, width**-2))
    member = np.where(varied, np.cumsum(varied) - 1, -1)
    lower, upper = _bounds(model, prior_sd, specification, names)
    parametrisation = Parametrisation(
        model.parameters,
        coordinate_of=member,
        scale=np.where(varied & is_tolerance, prior_sd, np.where(usual > 0, usual, 1.0)),
        fixed=model.drawn,
        is_tolerance=is_tolerance[varied],
        precision=precision[varied],
        lower=lower[varied],
        upper=upper[varied],
    )
    return _tie(parametrisation, specification.ties, names)


def _prior_sd(parameter: Parameter, tolerance: Tolerance) -> float:
    """Return the standard deviation of a tolerance: infinite if free, zero if known exactly."""
    if parameter.known == "free" or _has_default_width(parameter, tolerance):
        return np.inf
    if parameter.known == "undrawn_damping":
        return np.inf if tolerance.damping > 1 else 0.0
    if parameter.known == "exactly":
        return 0.0
    if parameter.known == "unknown_gain":
        return UNKNOWN_GAIN_SD
    spread = float(getattr(tolerance, parameter.known))
    if parameter.known in _FACTORS:
        return float(np.log(spread))
    relative = parameter.known in _RELATIVE_TOLERANCES and not parameter.positive
    return spread * abs(parameter.drawn) if relative else spread


def _has_default_width(parameter: Parameter, tolerance: Tolerance) -> bool:
    """Return whether a stiffness or damping is known to the default factor only."""
    kind = parameter.known
    return kind in _FACTORS and getattr(tolerance, kind) == getattr(Tolerance, kind)


def _prior_width(parameter: Parameter, tolerance: Tolerance) -> float:
    """Return the width of the prior of stiffness and damping that have no tolerance.

    It is the standard deviation of the logarithm, or 1 in units of usual damping, and infinite for
    any other parameter.
    """
    if parameter.known == "undrawn_damping":
        return 1.0
    if not _has_default_width(parameter, tolerance):
        return np.inf
    return float(np.log(getattr(tolerance, parameter.known)))


def _bounds(
    model: Model, prior_sd: Real, specification: UserSpecification, names: list[str]
) -> tuple[Real, Real]:
    """Return lower and upper bounds of x for each parameter; (n_parameter,) each."""
    positive = np.array([parameter.positive for parameter in model.parameters], bool)
    widest = np.where(
        np.isfinite(prior_sd), TOLERANCE_BOUND_SIGMA, np.where(positive, FREE_RANGE_LOG, np.inf)
    )
    undrawn = np.array([parameter.known == "undrawn_damping" for parameter in model.parameters])
    lower, upper = np.where(undrawn, 0.0, -widest), widest.copy()
    for pattern, (low, high) in specification.bounds.items():
        for place in match_pattern(pattern, names):
            drawn, scale = (
                model.drawn[place],
                prior_sd[place] if np.isfinite(prior_sd[place]) else 1.0,
            )
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


def _tie(
    parametrisation: Parametrisation, ties: Sequence[Sequence[str]], names: list[str]
) -> Parametrisation:
    """Return a parametrisation in which the parameters of each tie share one coordinate."""
    if not ties:
        return parametrisation
    coordinate_of = parametrisation.coordinate_of.copy()
    for patterns in ties:
        places = np.flatnonzero(_match_any(patterns, names))
        coordinates = sorted({int(coordinate_of[place]) for place in places})
        kinds = {
            (
                parametrisation.parameters[k].positive,
                parametrisation.parameters[k].unit,
                float(parametrisation.scale[k]),
                bool(np.append(parametrisation.is_tolerance, False)[coordinate_of[k]]),
            )
            for k in places
        }
        if not coordinates or coordinates[0] < 0 or len(kinds) > 1:
            raise InputError(
                f"[tuning] {', '.join(names[k] for k in places)} cannot be tied: name parameters "
                "of one unit and one prior that vary"
            )
        coordinate_of[np.isin(coordinate_of, coordinates[1:])] = coordinates[0]
    kept = np.unique(coordinate_of[coordinate_of >= 0])
    lower, upper = (
        np.array([combine(values[parametrisation.coordinate_of[coordinate_of == k]]) for k in kept])
        for values, combine in ((parametrisation.lower, np.max), (parametrisation.upper, np.min))
    )
    number = np.full(parametrisation.size + 1, -1)
    number[kept] = np.arange(len(kept))
    return replace(
        parametrisation,
        coordinate_of=number[coordinate_of],
        is_tolerance=parametrisation.is_tolerance[kept],
        precision=parametrisation.precision[kept],
        lower=lower.reshape(-1),
        upper=upper.reshape(-1),
    )


def _match_any(patterns: Sequence[str], names: list[str]) -> Mask:
    """Return whether each name fits any of the patterns; (n_parameter,)."""
    chosen = np.zeros(len(names), bool)
    for pattern in patterns:
        chosen[match_pattern(pattern, names)] = True
    return chosen


def match_pattern(pattern: str, names: list[str], place: str = "[tuning]") -> list[int]:
    """Return the indices of the names that a pattern fits.

    Args:
        pattern: a name, or a pattern with * and ?.
        place: where the user wrote the pattern, for the message.

    Raises:
        InputError: the pattern fits no name; the message gives a similar one, or the first names.
    """
    indices = [k for k, name in enumerate(names) if name == pattern or fnmatchcase(name, pattern)]
    if not indices:
        near = get_close_matches(pattern, names, 1)
        hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(names[:3])}, ..."
        raise InputError(f"{place} {pattern!r} fits no parameter: {hint}")
    return indices
