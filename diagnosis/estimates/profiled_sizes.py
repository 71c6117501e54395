r"""Size of a cause with an interval that leaves out the value of no effect.

A cause is named by its size: the mass of an appendage, the stiffness of a link, a gain. Without an
effect all coordinates x of the cause are zero, and the stated size has a value s_0: 0, or 1 for
factors and gains. An interval from the covariance at the minimum assumes a parabola. Where it holds
s_0, because a link may be any stiff or sizes make up for each other, the profile decides instead
(Venzon and Moolgavkar 1988): with everything else refitted at each value v of the coordinate that
makes most of the size,

    D(v) = 2 N [c(v) - c(v_fit)],

c being the cost per value that a refit minimises and N the number of independent values. The ends
of the interval are at D = 3.84, that towards no effect of a size that cannot be negative at 2.7.
The size is one if D without the effect, all its coordinates zero, is more (``size_profile``).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from diagnosis.estimates.intervals import FittedParameters
from diagnosis.estimates.size_profile import SizeProfile, remove_cause
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.levels.law_hypothesis import LawPart
from diagnosis.refits.refit import Refit, map_values
from diagnosis.settings import DiagnosisSettings
from diagnosis.stated_values import Ends, Value, end_at, is_scaled, list_components, list_pairs
from tuning import Parametrisation


@dataclass(frozen=True, eq=False)
class NamedSize:
    """Intervals of the parameters of a cause, and whether its size is one.

    Args:
        intervals: 95 % intervals of its parameters, by name.
        excludes_no_effect: whether the interval of its size leaves out the value of no effect.
    """

    intervals: Mapping[str, Ends]
    excludes_no_effect: bool


def find_named_size(
    scene: Scene,
    refit: Refit,
    parameters: FittedParameters,
    cause: Hypothesis,
    settings: DiagnosisSettings,
) -> NamedSize:
    """Return the intervals of a cause, that of its size by its profile where it is needed.

    Causes without a stated size, as exchanged channels or the mode of a body, have no such value.
    Laws of a joint have none either: the coordinates of their parameters are logarithms.

    Args:
        scene: thinning of the lines, and processes.
        parameters: its parameters with their confidence.
    """
    fitted, intervals = parameters.state_parameters(cause), parameters.estimate_intervals(cause)
    # An effect that is not there may state nothing, as a rigid mounting has no frequency.
    at_zero = map_values(parameters.parametrisation, remove_cause(parameters, cause))
    nothing = cause.state(at_zero)
    without, size = fitted | nothing, next(iter(fitted), None)
    if _is_one_sided(parameters.parametrisation, cause):
        intervals |= {
            name: end_at(nothing[name], fitted[name], ends)
            for name, ends in intervals.items()
            if name in nothing and is_scaled(cause.effect, name)
        }
    is_law = any(isinstance(part, LawPart) for part in cause.parts)
    if size not in intervals or is_law or not _differs(fitted[size], without[size]):
        return NamedSize(intervals, excludes_no_effect=True)
    if _excludes(intervals[size], without[size]):
        return NamedSize(intervals, excludes_no_effect=True)
    profile = SizeProfile.along(scene, refit, parameters, cause, size, settings)
    if profile is None or not profile.shows_size:
        return NamedSize(intervals, excludes_no_effect=False)
    pairs, middles = list_pairs(intervals[size]), list_components(fitted[size])
    profiled = profile.find_ends()
    # Where other coordinates make up for the held one, the stated size may grow as it falls.
    if profiled is None or profiled[0] <= middles[profile.component] <= profiled[1]:
        pairs[profile.component] = profiled
    ends = tuple(pairs) if isinstance(fitted[size], tuple) else pairs[0]
    kept = {name: each for name, each in intervals.items() if name != size}
    return NamedSize(kept | ({} if ends is None else {size: ends}), excludes_no_effect=True)


def _differs(first: Value, second: Value) -> bool:
    """Return whether a size depends on the coordinates of the cause."""
    change = np.abs(list_components(first) - list_components(second))
    return bool(np.nanmax(change, initial=0.0) > 0)


def _is_one_sided(varies: Parametrisation, cause: Hypothesis) -> bool:
    """Return whether no coordinate that makes a size can be negative."""
    makes_size = np.isin(np.array(varies.names), cause.coordinates) & ~varies.is_tolerance
    return bool(makes_size.any() and (varies.lower[makes_size] >= 0).all())


def _excludes(ends: Ends, without: Value) -> bool:
    """Return whether the interval of a component leaves out its value of no effect."""
    values = list_components(without).tolist()
    return any(
        pair is not None and not pair[0] <= value <= pair[1]
        for pair, value in zip(list_pairs(ends), values, strict=True)
    )
