"""Stages of a fit, with a falling model-error floor, and the minimisation of one of them.

Gauss-Newton and NLopt start from the same damping and end by the same rule: when a step is
predicted to decrease the misfit by less than the stage asks for. Where normal equations come from
few lines, all lines follow.

A gain of 0.01 nats is negligible where the residual is noise. Where the model leaves more, its
residual has the variance phi = J / N_eff per independent value, and a log likelihood counts over
phi (quasi-likelihood, McCullagh and Nelder 1989, ch. 9). A step is then negligible below 0.01 phi:
without this, a search of a model that lacks something follows its errors for hundreds of steps.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from identification.words import Campaign, Integers, Mask, Real
from mbmodel import Model
from tuning.misfit.misfit import Misfit
from tuning.misfit.normal_equations import ArrowMatrix
from tuning.misfit.residual_statistics import independent_share
from tuning.misfit.sparse_misfit import SparseMisfit
from tuning.misfit.weights import squared_size
from tuning.parametrisation.parametrisation import Parametrisation
from tuning.solvers.gauss_newton import LARGEST_STEP, Box, gauss_newton
from tuning.solvers.nlopt_solver import Minimum
from tuning.solvers.whitened_search import search_whitened

_MIN_THINNED_LINES = 32  # that thinning leaves
_MIN_NORMAL_LINES = 128  # from which normal equations come


@dataclass(frozen=True)
class Stage:
    """One minimisation of the FRF misfit.

    Args:
        model_error_floor: relative model error that the fit tolerates.
        tolerance: the search ends when a step is predicted to gain less than this part of the cost.
        stride: only every ``stride``-th line counts.
        logarithmic: whether the residual is the logarithm of the ratio.
        tolerances_vary: whether tolerances vary too, or only parameters without a prior.
        at_bodies: whether differences count at the centres of mass instead of the channels.
        max_steps: number of Gauss-Newton steps, or of whitenings with NLopt, after which the stage
            ends.
        exact_curvature: whether stalled steps are replaced by steps with the exact curvature.
        normal_stride: normal equations come from every ``normal_stride``-th of the lines that
            count, but from at least 128 lines; near the minimum they come from all.
    """

    model_error_floor: float
    tolerance: float = 1e-3
    stride: int = 1
    logarithmic: bool = True
    tolerances_vary: bool = False
    at_bodies: bool = False
    max_steps: int = 60
    exact_curvature: bool = False
    normal_stride: int = 1

    def build_misfit(
        self,
        model: Model,
        campaign: Campaign,
        parametrisation: Parametrisation,
        *,
        counted: Mask | None = None,
        threads: int = 1,
    ) -> Misfit:
        """Return the misfit of this stage.

        Args:
            counted: whether each line counts, all if None; (n_freq,).
            threads: threads that form the normal equations.
        """
        return Misfit(
            model,
            campaign,
            parametrisation,
            model_error_floor=self.model_error_floor,
            logarithmic=self.logarithmic,
            at_bodies=self.at_bodies,
            counted=counted,
            threads=threads,
        )

    def build_problem(
        self,
        model: Model,
        campaign: Campaign,
        parametrisation: Parametrisation,
        *,
        counted: Mask | None = None,
        threads: int = 1,
    ) -> Misfit | SparseMisfit:
        """Return the problem to minimise: the misfit, with normal equations of fewer lines.

        Args:
            campaign, counted (n_freq,), threads: as for ``build_misfit``.
        """
        whole = self.build_misfit(
            model, campaign, parametrisation, counted=counted, threads=threads
        )
        thin_span, ratio = self._thin_normal_lines(campaign)
        if ratio == 1:
            return whole
        counted_thin = None if counted is None else counted[thin_span]
        thin_misfit = self.build_misfit(
            model,
            campaign.select_lines(thin_span),
            parametrisation,
            counted=counted_thin,
            threads=threads,
        )
        return SparseMisfit(whole, thin_misfit, ratio)

    def leave_out_normals(
        self,
        model: Model,
        campaign: Campaign,
        parametrisation: Parametrisation,
        x: Real,
        folds: Integers,
        threads: int = 1,
    ) -> list[ArrowMatrix]:
        """Return the normal equations of all lines but one fold, for each fold.

        Args:
            campaign, threads: as for ``build_misfit``.
            x: coordinates; (n_x,).
            folds: fold of each line, from 0; (n_freq,).
        """
        thin_span, ratio = self._thin_normal_lines(campaign)
        problem = self.build_misfit(
            model, campaign.select_lines(thin_span), parametrisation, threads=threads
        )
        return [
            normal * ratio
            for _, _, normal in problem.quadratic_models_by_fold(x, folds[thin_span])[1:]
        ]

    def _thin_normal_lines(self, campaign: Campaign) -> tuple[slice, float]:
        """Return the lines from which normal equations come, and the ratio of all lines to them."""
        n_freq = len(campaign.freq_hz)
        thin_span = thinning_slice(
            n_freq, min(self.normal_stride, max(1, n_freq // _MIN_NORMAL_LINES))
        )
        return thin_span, n_freq / len(range(n_freq)[thin_span])


STAGES = (
    Stage(0.5, stride=8),
    Stage(0.2, stride=8),
    Stage(0.1, stride=4, tolerances_vary=True),
    Stage(0.03, stride=4, logarithmic=False, tolerances_vary=True),
    Stage(0.0, stride=4, logarithmic=False, tolerances_vary=True),
    Stage(
        0.0,
        tolerance=1e-8,
        logarithmic=False,
        tolerances_vary=True,
        exact_curvature=True,
        normal_stride=4,
    ),
)
LAST_STAGE = STAGES[-1]


def thin_lines(campaign: Campaign, stride: int) -> Campaign:
    """Return a campaign with every ``stride``-th line, but at least 32 lines if it has them."""
    return campaign.select_lines(thinning_slice(len(campaign.freq_hz), stride))


def thinning_slice(n_freq: int, stride: int) -> slice:
    """Return the slice of lines that ``thin_lines`` keeps."""
    stride = min(stride, max(1, n_freq // _MIN_THINNED_LINES))
    return slice(stride // 2, None, stride)


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
