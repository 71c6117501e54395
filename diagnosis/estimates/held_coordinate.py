"""Deviance of a fit with one of its coordinates held: everything else is fitted anew.

A size and the ends of its interval come from one kind of fit (``intervals.fit_parameters``). Where
more than noise remains, this is the refit at its own model error, with

    D = 2 N [c - c_fit],

c being its cost per value and N the number of independent values. Where little but noise remains,
it is the final fit to all lines, with its cost C and its variance inflation s^2:

    D = 2 [C - C_fit] / s^2.
"""

from collections.abc import Callable
from dataclasses import replace

from diagnosis.estimates.intervals import FittedParameters, fit_final_stage
from diagnosis.hypothesis import Scene
from diagnosis.inference.calibration import load_calibration
from diagnosis.refits.refit import Refit
from diagnosis.refits.refitting import RefitTask, run_refits
from diagnosis.settings import DiagnosisSettings
from identification.words import Real
from tuning import Parametrisation

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
