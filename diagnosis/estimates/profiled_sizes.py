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
The size is one if D without an effect is more. The ends are found on r = sqrt(D), which is a
straight line for a parabola, by a few steps of regula falsi (Dowell and Jarratt 1971).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from diagnosis.estimates.held_coordinate import find_deviance
from diagnosis.estimates.intervals import FittedParameters
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.levels.law_hypothesis import LawPart
from diagnosis.refits.extended_parametrisation import hold_parameters
from diagnosis.refits.refit import Refit, map_values
from diagnosis.settings import DiagnosisSettings
from diagnosis.stated_values import Ends, Value, end_at, is_scaled, list_components, list_pairs
from identification.words import Real
from tuning import NORMAL_QUANTILE_95, Fit, Parametrisation

_QUANTILE = NORMAL_QUANTILE_95 * NORMAL_QUANTILE_95  # D at the ends of a 95 % interval
_ONE_SIDED_QUANTILE = float(chdtri(1, 0.10))  # of a size that cannot be negative: 2.7
_MAX_SECANT_STEPS = 4  # of regula falsi to each end: D is then known to some tenths
_MAX_DOUBLINGS = 3  # of the way to an upper end: a link far stiffer than the fit may do as well
_ROOT_TOLERANCE = 0.15  # of sqrt(D): a twelfth of the interval's half width


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
    at_zero = map_values(parameters.parametrisation, _remove(parameters, cause))
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
    profile = _Profile.along(scene, refit, parameters, cause, size, settings)
    if profile is None or not profile.shows_size:
        return NamedSize(intervals, excludes_no_effect=False)
    pairs = list_pairs(intervals[size])
    pairs[profile.component] = profile.find_ends()
    ends = tuple(pairs) if isinstance(fitted[size], tuple) else pairs[0]
    kept = {name: each for name, each in intervals.items() if name != size}
    return NamedSize(kept | ({} if ends is None else {size: ends}), excludes_no_effect=True)


def _remove(parameters: FittedParameters, cause: Hypothesis) -> Real:
    """Return the parameters [SI] with all coordinates of a cause at zero; (n_parameter,)."""
    varies = parameters.parametrisation
    x = varies.coordinates(parameters.theta)
    return varies.theta(np.where(np.isin(np.array(varies.names), cause.coordinates), 0.0, x))


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


@dataclass(frozen=True, eq=False)
class _Profile:
    """Profile of the coordinate that makes most of a size.

    Args:
        fit: fit that states the size.
        cause: the cause.
        name: name of the coordinate.
        size: name of the stated size.
        component: its component that the coordinate makes most of.
        root: returns sqrt(D) and the stated component with the coordinate held.
        without: sqrt(D) without the coordinate.
    """

    fit: Fit
    cause: Hypothesis
    name: str
    size: str
    component: int
    root: Callable[[float], tuple[float, float]]
    without: float

    @classmethod
    def along(  # the arguments of ``find_named_size``, and the size
        cls,
        scene: Scene,
        refit: Refit,
        parameters: FittedParameters,
        cause: Hypothesis,
        size: str,
        settings: DiagnosisSettings,
    ) -> "_Profile | None":
        """Return the profile of a size; None if no free coordinate of the cause makes it."""
        stating = parameters.fit or refit.fit
        varies, x = stating.parametrisation, stating.x
        fitted = cause.state(map_values(varies, varies.theta(x)))

        def state(coordinates: Real) -> Real:
            values = map_values(varies, varies.theta(coordinates))
            return list_components((fitted | cause.state(values))[size])

        changes = {
            name: np.nan_to_num(np.abs(state(np.where(at == np.arange(len(x)), 0.0, x)) - state(x)))
            for at, name in enumerate(varies.names)
            if name in cause.coordinates and x[at] != 0
        }
        name = max(changes, key=lambda each: changes[each].max(), default=None)
        if name is None or not changes[name].max() > 0:
            return None
        component = int(changes[name].argmax())
        deviance_at = find_deviance(scene, refit, parameters, settings)

        def root(value: float) -> tuple[float, float]:
            at = np.where(np.array(varies.names) == name, value, x)
            start = varies.theta(at)
            deviance, theta = deviance_at(hold_parameters(varies, start, (name,)), start)
            values = cause.state(map_values(varies, theta))
            return float(np.sqrt(max(deviance, 0.0))), float(
                list_components(values[size])[component]
            )

        return cls(stating, cause, name, size, component, root, root(0.0)[0])

    @property
    def _at(self) -> int:
        """Number of the coordinate."""
        return self.fit.parametrisation.names.index(self.name)

    @property
    def _fitted(self) -> float:
        return float(self.fit.x[self._at])

    @property
    def _near_quantile(self) -> float:
        """D at the end towards no effect: by one side where the size cannot be negative."""
        bounds = self.cause.bounds.get(self.name, (-np.inf, np.inf))
        is_one_sided = self.cause.signed or bounds[0] == 0.0
        return _ONE_SIDED_QUANTILE if is_one_sided else _QUANTILE

    @property
    def shows_size(self) -> bool:
        """Whether the interval of the size leaves out no effect."""
        return self.without**2 > self._near_quantile

    def find_ends(self) -> tuple[float, float] | None:
        """Return the ends of the stated component; None if it has no end away from no effect."""
        varies = self.fit.parametrisation
        limits = float(varies.lower[self._at]), float(varies.upper[self._at])
        value = self._fitted
        for _ in range(_MAX_DOUBLINGS):
            value = float(np.clip(2 * value, *limits))
            root, stated = self.root(value)
            if root**2 >= _QUANTILE or value in limits:
                break
        else:
            return None
        far = stated if root**2 < _QUANTILE else self._find_end((value, root), _QUANTILE)
        ends = sorted((self._find_end((0.0, self.without), self._near_quantile), far))
        return ends[0], ends[1]

    def _find_end(self, outside: tuple[float, float], deviance: float) -> float:
        """Return the stated component where D has a value.

        Args:
            outside: a value of the coordinate beyond the end, and sqrt(D) there.
            deviance: D at the end.
        """
        wanted = float(np.sqrt(deviance))
        inside, outside = (self._fitted, -wanted), (outside[0], outside[1] - wanted)
        stated, was_outside = 0.0, None
        for _ in range(_MAX_SECANT_STEPS):
            share = inside[1] / (inside[1] - outside[1])
            value = inside[0] + share * (outside[0] - inside[0])
            root, stated = self.root(value)
            beyond = root - wanted
            if abs(beyond) <= _ROOT_TOLERANCE:
                break
            is_outside = beyond > 0
            shrink = 0.5 if is_outside == was_outside else 1.0
            if is_outside:
                inside, outside = (inside[0], shrink * inside[1]), (value, beyond)
            else:
                inside, outside = (value, beyond), (outside[0], shrink * outside[1])
            was_outside = is_outside
        return stated
