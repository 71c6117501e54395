"""Held-out lines: K-fold cross-validation with blocks from resonance to resonance.

Neighbouring lines within a resonance predict each other. Folds therefore consist of contiguous
blocks (``held_out_blocks``), which are assigned to five folds in turn (Roberts et al. 2017,
Ecography 40). The gap of these predictions is computed by ``tuning.assessment.gap``.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from identification.words import Campaign, Complex, Integers, Mask, Real
from mbmodel import Model
from tuning.assessment.held_out_blocks import assign_folds, find_blocks
from tuning.fitting.checkpoint import Checkpoint
from tuning.fitting.error_floor_fit import FloorSchedule
from tuning.fitting.fitter import Fit
from tuning.fitting.stage_search import minimise_stage
from tuning.fitting.stages import LAST_STAGE, thin_lines, thinning_slice
from tuning.misfit.batch import predict
from tuning.misfit.normal_equations import ArrowMatrix
from tuning.misfit.residual_statistics import residual_statistics
from tuning.solvers.nlopt_solver import Minimum, Outcome

# Predicted gain of a step that ends the fit of a fold: a third of a standard deviation.
_MIN_FOLD_GAIN_NATS = 0.05


@dataclass(frozen=True, eq=False)
class HeldOutFits:
    """Fits that left out one fold of the lines each.

    Args:
        thetas: parameters of each fold's fit [SI]; (n_fold, n_parameter), 5 folds unless there are
            fewer blocks.
        outcomes: how each fold's search ended; n_fold.
        starts: first line of each block, in ascending order; (n_block,).
        folds: fold of each line; (n_freq,).
    """

    thetas: Real
    outcomes: tuple[Outcome, ...]
    starts: Integers
    folds: Integers

    def predict(self, model: Model, campaign: Campaign) -> tuple[Complex, ...]:
        """Predict each test's FRFs in its labels, each line by the fit that left it out.

        Args:
            campaign: any channels on the lines of the fits.

        Returns:
            One array for each test; (n_freq, n_out, 1).
        """
        predicted = [np.zeros_like(test.estimate.frf.values) for test in campaign.tests]
        for fold, theta in enumerate(self.thetas):
            is_held_out = self.folds == fold
            if is_held_out.any():
                for values, answer in zip(
                    predicted,
                    predict(model, theta, campaign.select_lines(is_held_out)),
                    strict=True,
                ):
                    values[is_held_out] = answer
        return tuple(predicted)


def fit_held_out(
    model: Model,
    full_fit: Fit,
    campaign: Campaign,
    *,
    jobs: int = 1,
    min_gain_nats: float = _MIN_FOLD_GAIN_NATS,
    report: Callable[[int], None] | None = None,
    checkpoint: Checkpoint | None = None,
) -> HeldOutFits | None:
    """Fit the lines of all folds but one, for each fold, starting at the fit to all lines.

    If the fit counted every k-th line only, folds are left out of these; blocks are still those of
    all lines.

    Args:
        full_fit: fit to all folds.
        campaign: tests on the lines of the band.
        jobs: threads; the result does not depend on it.
        min_gain_nats: predicted decrease of J below which no further step is taken.
        report: called with the number of each finished fold.

    Returns:
        The fits; None if the band consists of a single block, which no other line could predict.

    Raises:
        KeyboardInterrupt: interrupted; there is no held-out prediction then.
    """
    parametrisation = full_fit.parametrisation
    starts = find_blocks(campaign)
    folds = assign_folds(starts, len(campaign.freq_hz))
    if not folds.any():
        return None
    checkpoint = Checkpoint() if checkpoint is None else checkpoint
    stage = full_fit.last_stage or LAST_STAGE
    campaign, fold_of_line = (
        thin_lines(campaign, stage.stride),
        folds[thinning_slice(len(folds), stage.stride)],
    )
    ends = {fold: checkpoint.recall(f"fold {fold}") for fold in range(int(folds.max()) + 1)}
    missing = [fold for fold, end in ends.items() if end is None]
    normals = (
        stage.leave_out_normals(model, campaign, parametrisation, full_fit.x, fold_of_line, jobs)
        if missing
        else []
    )
    work = (
        delayed(_fit_without)(
            model, campaign, full_fit, fold_of_line != fold, normals[fold], min_gain_nats
        )
        for fold in missing
    )
    with threadpool_limits(1):
        results = Parallel(n_jobs=jobs, prefer="threads", return_as="generator")(work)
        for fold, end in zip(missing, results, strict=True):
            checkpoint.keep(f"fold {fold}", end)
            ends[fold] = end
            if report is not None:
                report(fold)
    finished = [end for end in ends.values() if end is not None]
    thetas = np.array([parametrisation.theta(end.x) for end in finished])
    return HeldOutFits(thetas, tuple(end.outcome for end in finished), starts, folds)


def hold_out_lines(
    model: Model,
    campaign: Campaign,
    settled: Fit,
    schedule: FloorSchedule,
    *,
    jobs: int = 1,
    report: Callable[[int], None] | None = None,
    checkpoint: Checkpoint | None = None,
) -> HeldOutFits | None:
    """Fit all folds of the lines but one, for each fold, at the model error of a fit's residuals.

    These fits count twice as many lines as that fit.

    Args:
        campaign, jobs, report: as for ``fit_held_out``.
        settled: fit to all folds at its own floor.

    Returns:
        The fits; None if the band consists of a single block.

    Raises:
        KeyboardInterrupt: interrupted.
        ValueError: no channel moves.
    """
    counted = thin_lines(campaign, schedule.stride // 2)
    statistics = residual_statistics(predict(model, settled.theta, counted), counted)
    if statistics is None:
        raise ValueError("no channel moves, so that no model error shows")
    stage = replace(schedule.stage(statistics.floor), stride=schedule.stride // 2)
    return fit_held_out(
        model,
        replace(settled, last_stage=stage),
        campaign,
        jobs=jobs,
        report=report,
        checkpoint=checkpoint,
    )


def _fit_without(
    model: Model,
    campaign: Campaign,
    full_fit: Fit,
    kept: Mask,
    normal: ArrowMatrix,
    min_gain_nats: float,
) -> Minimum:
    """Fit the lines that are kept, from the fit to all lines; mostly a single step."""
    stage = full_fit.last_stage or LAST_STAGE
    problem = stage.build_problem(model, campaign, full_fit.parametrisation, counted=kept)
    end = minimise_stage(
        problem,
        full_fit.parametrisation,
        full_fit.x,
        stage,
        initial_normal=normal,
        min_gain_nats=min_gain_nats,
    )
    if end.outcome == "interrupted":
        raise KeyboardInterrupt
    return end
