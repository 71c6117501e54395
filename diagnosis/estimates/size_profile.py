r"""Profile of a size: the deviance of fits with a coordinate held, everything else fitted anew.

A size and the ends of its interval come from one kind of fit (``intervals.fit_parameters``). Where
more than noise remains, this is the refit at its own model error, with

    D = 2 N [c - c_fit],

c being its cost per value and N the number of independent values. Where little but noise remains,
it is the final fit to all lines, with its cost C and its variance inflation s^2:

    D = 2 [C - C_fit] / s^2.

The ends of an interval are found on r = sqrt(D), which is a straight line for a parabola, by a few
steps of regula falsi (Dowell and Jarratt 1971).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from diagnosis.estimates.intervals import FittedParameters, fit_final_stage
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.inference.calibration import load_calibration
from diagnosis.refits.extended_parametrisation import hold_parameters
from diagnosis.refits.refit import Refit, map_values
from diagnosis.refits.refitting import RefitTask, run_refits
from diagnosis.settings import DiagnosisSettings
from diagnosis.stated_values import list_components
from identification.words import Real
from tuning import NORMAL_QUANTILE_95, Fit, Parametrisation

_QUANTILE = NORMAL_QUANTILE_95 * NORMAL_QUANTILE_95  # D at the ends of a 95 % interval
_ONE_SIDED_QUANTILE = float(chdtri(1, 0.10))  # of a size that cannot be negative: 2.7
_MAX_SECANT_STEPS = 4  # of regula falsi to each end: D is then known to some tenths
_MAX_DOUBLINGS = 3  # of the way to an upper end: a link far stiffer than the fit may do as well
_ROOT_TOLERANCE = 0.15  # of sqrt(D): a twelfth of the interval's half width
DevianceAt = Callable[[Parametrisation, Real], tuple[float, Real]]  # D and theta


def find_deviance(
    scene: Scene, refit: Refit, parameters: FittedParameters, settings: DiagnosisSettings
) -> DevianceAt:
    """Return what fits D and theta [SI] by the coordinates that vary and the start [SI].

    Args:
        parameters: parameters that state the size, with their fit.
    """
    final = parameters.fit
    if final is None or final is refit.fit or final.last_stage is None:
        count = refit.summary.count_independent(load_calibration())

        def refit_at(held: Parametrisation, start: Real) -> tuple[float, Real]:
            session = replace(refit.session, parametrisation=held)
            task = RefitTask(refit.causes, session, start, refit.floor)
            (end,) = run_refits(scene, [task], settings.schedule)
            return 2 * count * (end.objective - refit.objective), end.fit.theta

        return refit_at
    stage, cost, inflation = final.last_stage, final.cost, parameters.confidence.variance_inflation

    def fit_at(held: Parametrisation, start: Real) -> tuple[float, Real]:
        end = fit_final_stage(replace(refit.session, parametrisation=held), start, stage)
        return 2 * (end.cost - cost) / inflation, end.theta

    return fit_at


def remove_cause(parameters: FittedParameters, cause: Hypothesis) -> Real:
    """Return the parameters [SI] with all coordinates of a cause at zero; (n_parameter,)."""
    varies = parameters.parametrisation
    x = varies.coordinates(parameters.theta)
    return varies.theta(np.where(np.isin(np.array(varies.names), cause.coordinates), 0.0, x))


@dataclass(frozen=True, eq=False)
class SizeProfile:
    """Profile of the coordinate that makes most of a size.

    Args:
        fit: fit that states the size.
        cause: the cause.
        name: name of the coordinate.
        size: name of the stated size.
        component: its component that the coordinate makes most of.
        root: returns sqrt(D) and the stated component with the coordinate held.
        at_zero: sqrt(D) and the stated component without the coordinate.
        without_cause: sqrt(D) without the cause: all its coordinates are zero.
    """

    fit: Fit
    cause: Hypothesis
    name: str
    size: str
    component: int
    root: Callable[[float], tuple[float, float]]
    at_zero: tuple[float, float]
    without_cause: float

    @classmethod
    def along(  # the arguments of ``find_named_size``, and the size
        cls,
        scene: Scene,
        refit: Refit,
        parameters: FittedParameters,
        cause: Hypothesis,
        size: str,
        settings: DiagnosisSettings,
    ) -> "SizeProfile | None":
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

        at_zero = without_cause, _ = root(0.0)
        if set(cause.coordinates) & set(varies.names) != {name}:
            start = remove_cause(parameters, cause)
            added = [p.name for part in cause.parts for p in part.parameters]
            held = hold_parameters(varies, start, (*cause.coordinates, *added))
            without_cause = float(np.sqrt(max(deviance_at(held, start)[0], 0.0)))
        return cls(stating, cause, name, size, component, root, at_zero, without_cause)

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
        """Whether the data leave out that there is no effect."""
        return self.without_cause**2 > self._near_quantile

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
        root, near = self.at_zero
        if root**2 > self._near_quantile:
            near = self._find_end((0.0, root), self._near_quantile)
        return min(near, far), max(near, far)

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
