"""Minimisation of one stage of a fit, by the Gauss-Newton method or by NLopt.

Both start from the same damping and end by the same rule: when a step is predicted to decrease the
misfit by less than the stage asks for. Where normal equations come from few lines, all lines follow
from where these end.

A gain of 0.01 nats is negligible where the residual is noise. Where the model leaves more, its
residual has the variance phi = J / N_eff per independent value, and a log likelihood counts over
phi (quasi-likelihood, McCullagh and Nelder 1989, ch. 9). A step is then negligible below 0.01 phi:
without this, a search of a model that lacks something follows its errors for hundreds of steps.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from identification.words import Real
from tuning.fitting.stages import Stage
from tuning.misfit.misfit import Misfit
from tuning.misfit.normal_equations import ArrowMatrix
from tuning.misfit.residual_statistics import independent_share
from tuning.misfit.sparse_misfit import SparseMisfit
from tuning.misfit.weights import squared_size
from tuning.parametrisation.parametrisation import Parametrisation
from tuning.solvers.gauss_newton import LARGEST_STEP, Box, gauss_newton
from tuning.solvers.nlopt_solver import Minimum
from tuning.solvers.whitened_search import search_whitened

GAUSS_NEWTON = "GAUSS_NEWTON"
_START_DAMPING = 1e-3  # Levenberg-Marquardt damping at the start of a stage
_FINAL_START_DAMPING = 1e-7  # of a stage without model-error floor, which starts near its minimum


def minimise_stage(
    problem: Misfit | SparseMisfit,
    parametrisation: Parametrisation,
    x: Real,
    stage: Stage,
    *,
    algorithm: str = GAUSS_NEWTON,
    initial_normal: ArrowMatrix | None = None,
    min_gain_nats: float = 0.01,
    report: Callable[[int, float], None] | None = None,
) -> Minimum:
    """Minimise the misfit of a stage within bounds and with priors.

    Args:
        problem: misfit of the stage.
        x: start; (n_x,).
        stage: stage, which says when to end.
        algorithm: the Gauss-Newton method, or the name of an algorithm of NLopt.
        initial_normal: normal equations near x, if available, for the Gauss-Newton method.
        min_gain_nats: the search ends when the next step is predicted to decrease J by less.
        report: called with the number of evaluations and the best value.
    """
    box = _stage_box(parametrisation)
    damping = _START_DAMPING if stage.model_error_floor > 0 else _FINAL_START_DAMPING

    def search(phase: Misfit | SparseMisfit, start: Minimum, tolerance: float) -> Minimum:
        def report_all(count: int, value: float) -> None:
            if report is not None:
                report(start.evaluations + count, value)

        if algorithm != GAUSS_NEWTON:
            end = search_whitened(
                phase,
                start.x,
                box,
                algorithm=algorithm,
                damping=damping,
                min_gain_nats=min_gain_nats,
                tolerance=tolerance,
                max_whitenings=stage.max_steps,
                report=report_all,
            )
        else:
            end = gauss_newton(
                phase,
                start.x,
                box,
                initial_normal=None if start.evaluations else initial_normal,
                min_gain_nats=min_gain_nats,
                damping=damping,
                tolerance=tolerance,
                max_steps=stage.max_steps,
                exact_curvature=stage.exact_curvature,
                report=report_all,
            )
        return replace(end, evaluations=start.evaluations + end.evaluations)

    def search_dispersed(phase: Misfit | SparseMisfit, start: Minimum) -> Minimum:
        """Search with the dispersion of the start, again where that of the end is far less."""
        whole = phase.whole if isinstance(phase, SparseMisfit) else phase
        end, tolerance = start, _find_tolerance(whole, start.x, stage, min_gain_nats)
        while True:
            end = search(phase, end, tolerance)
            previous, tolerance = tolerance, _find_tolerance(whole, end.x, stage, min_gain_nats)
            if end.outcome != "converged" or tolerance > previous / 2:
                return end

    end = search_dispersed(problem, Minimum(x, np.inf, 0, "converged", ""))
    # Few lines may miss a narrow mode and predict no gain far from the minimum: all lines decide.
    if isinstance(problem, SparseMisfit) and end.outcome == "converged":
        end = search_dispersed(problem.whole, end)
    return end


def _stage_box(parametrisation: Parametrisation) -> Box:
    """Return bounds, prior and step limits of the coordinates that vary."""
    return Box(
        parametrisation.lower,
        parametrisation.upper,
        parametrisation.precision,
        np.where(
            parametrisation.is_logarithmic & ~parametrisation.is_tolerance,
            LARGEST_STEP / parametrisation.scales,
            np.inf,
        ),
    )


def _find_tolerance(whole: Misfit, x: Real, stage: Stage, min_gain_nats: float) -> float:
    """Return the part of J below which a step is negligible.

    It is in proportion to J, which falls during the search as the dispersion does.
    """
    dispersion = residual_dispersion(whole, x, stage)
    if dispersion <= 1:
        return stage.tolerance
    return stage.tolerance + min_gain_nats * (dispersion - 1) / whole.value(x)


def residual_dispersion(misfit: Misfit, x: Real, stage: Stage) -> float:
    """Return phi, the misfit per independent value of the residual; 1 where it is noise.

    Args:
        misfit: misfit of all lines.
        x: coordinates; (n_x,).
        stage: stage; its dispersion is 1 where its residuals are no differences at the channels.
    """
    if stage.logarithmic or stage.at_bodies:
        return 1.0
    total, independent = 0.0, 0.0
    for unit in misfit.unit_residuals(x):
        total += float(squared_size(unit).sum())
        share = min(1.0, independent_share(unit))
        independent += share * np.count_nonzero(unit)
    return max(1.0, total / max(independent, 1.0)) if np.isfinite(total) else 1.0
