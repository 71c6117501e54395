"""Stages of a fit: minimisations with a falling model-error floor (continuation)."""

from dataclasses import dataclass

from identification.words import Campaign, Integers, Mask, Real
from mbmodel import Model
from tuning.misfit.misfit import Misfit
from tuning.misfit.normal_equations import ArrowMatrix
from tuning.misfit.sparse_misfit import SparseMisfit
from tuning.parametrisation.parametrisation import Parametrisation

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
