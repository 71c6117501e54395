"""Minimisation of one stage of a fit, by the Gauss-Newton method or by NLopt.

Both start from the same damping and end by the same rule: when a step is predicted to decrease the
misfit by less than the stage asks for. Where normal equations come from few lines, all lines follow
from where these end.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from identification.words import Real
from tuning.fitting.stages import Stage
from tuning.misfit.misfit import Misfit
from tuning.misfit.normal_equations import ArrowMatrix
from tuning.misfit.sparse_misfit import SparseMisfit
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
        parametrisation: coordinates that vary.
        x: start; (n_x,).
        stage: stage, which says when to end.
        algorithm: the Gauss-Newton method, or the name of an algorithm of NLopt.
        initial_normal: normal equations near x, if available, for the Gauss-Newton method.
        min_gain_nats: the search ends when the next step is predicted to decrease J by less.
        report: called with the number of evaluations and the best value.
    """
    box = Box(
        parametrisation.lower,
        parametrisation.upper,
        parametrisation.has_prior.astype(float),
        np.where(
            parametrisation.is_logarithmic & ~parametrisation.has_prior,
            LARGEST_STEP / parametrisation.scales,
            np.inf,
        ),
    )
    damping = _START_DAMPING if stage.model_error_floor > 0 else _FINAL_START_DAMPING

    def search(phase: Misfit | SparseMisfit, start: Minimum) -> Minimum:
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
                tolerance=stage.tolerance,
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
                tolerance=stage.tolerance,
                max_steps=stage.max_steps,
                exact_curvature=stage.exact_curvature,
                report=report_all,
            )
        return replace(end, evaluations=start.evaluations + end.evaluations)

    end = search(problem, Minimum(x, np.inf, 0, "converged", ""))
    # Few lines may miss a narrow mode and predict no gain far from the minimum: all lines decide.
    if isinstance(problem, SparseMisfit) and end.outcome == "converged":
        end = search(problem.whole, end)
    return end
