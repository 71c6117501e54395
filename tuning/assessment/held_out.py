"""Held-out lines: K-fold cross-validation with blocks as wide as resonances.

Neighbouring lines within a resonance predict each other. Folds therefore consist of contiguous
blocks (Roberts et al. 2017, Ecography 40), which are assigned to five folds in turn. The gap of
these predictions is computed by ``tuning.assessment.gap``.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from identification.words import Campaign, Complex, Integers, Mask, Real
from mbmodel import Model, model_modes
from tuning.fitting.checkpoint import Checkpoint
from tuning.fitting.error_floor_fit import FloorSchedule
from tuning.fitting.fitter import Fit
from tuning.fitting.stage_search import minimise_stage
from tuning.fitting.stages import LAST_STAGE, thin_lines, thinning_slice
from tuning.misfit.batch import predict
from tuning.misfit.normal_equations import ArrowMatrix
from tuning.misfit.residual_statistics import residual_statistics
from tuning.solvers.nlopt_solver import Minimum, Outcome

N_FOLDS = 5
MIN_BLOCK_LINES = 8  # any shape along frequency fits fewer
# Predicted gain of a step that ends the fit of a fold: a third of a standard deviation.
_MIN_FOLD_GAIN_NATS = 0.05


@dataclass(frozen=True, eq=False)
class HeldOutFits:
    """Fits that left out one fold of the lines each.

    Args:
        thetas: parameters of each fold's fit [SI]; (n_fold, n_parameter), 5 folds unless there are
            fewer blocks.
        outcomes: how each fold's search ended; n_fold.
        folds: fold of each line; (n_freq,).
        width: number of lines in a block.
    """

    thetas: Real
    outcomes: tuple[Outcome, ...]
    folds: Integers
    width: int

    def predict(self, model: Model, campaign: Campaign) -> tuple[Complex, ...]:
        """Predict each test's FRFs in its labels, each line by the fit that left it out.

        Args:
            model: model that was fitted.
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


def block_width(model: Model, theta: Real, freq_hz: Real) -> int:
    """Return the number of lines in a block: three lower quartiles of the modes' bandwidth.

    The bandwidth of a mode is 2 zeta f; modes inside the band count. A block has at least 8 lines
    and at most a fifteenth of the band; in a band of less than 120 lines, 8 lines take precedence.
    Without a mode in the band, blocks are as wide as allowed.

    Args:
        model: tuned model.
        theta: its parameters [SI]; (n_parameter,).
        freq_hz: lines of the band; (n_freq,).
    """
    modes = model_modes(model, theta)
    is_inside = (
        (modes.freq_hz >= freq_hz[0]) & (modes.freq_hz <= freq_hz[-1]) & (modes.poles.imag > 0)
    )
    max_lines = len(freq_hz) // 15
    if not is_inside.any() or len(freq_hz) < 2:
        return max(MIN_BLOCK_LINES, max_lines)
    bandwidth = np.quantile(2 * modes.damping[is_inside] * modes.freq_hz[is_inside], 0.25)
    spacing = (freq_hz[-1] - freq_hz[0]) / (len(freq_hz) - 1)
    return max(MIN_BLOCK_LINES, min(round(float(3 * bandwidth / spacing)), max_lines))


def assign_folds(n_freq: int, width: int) -> Integers:
    """Return the fold of each line, with block i in fold i mod 5; (n_freq,)."""
    folds: Integers = (np.arange(n_freq) // width) % N_FOLDS
    return folds


def fit_held_out(
    model: Model,
    full_fit: Fit,
    campaign: Campaign,
    *,
    jobs: int = 1,
    width: int | None = None,
    min_gain_nats: float = _MIN_FOLD_GAIN_NATS,
    report: Callable[[int], None] | None = None,
    checkpoint: Checkpoint | None = None,
) -> HeldOutFits | None:
    """Fit the lines of all folds but one, for each fold, starting at the fit to all lines.

    If the fit counted every k-th line only, folds are left out of these; blocks are still those of
    all lines.

    Args:
        model: machine and Parts.
        full_fit: fit to all folds.
        campaign: tests on the lines of the band.
        jobs: threads; the result does not depend on it.
        width: number of lines in a block; by the fitted model's modes if None.
        min_gain_nats: predicted decrease of J below which no further step is taken.
        report: called with the number of each finished fold.
        checkpoint: finished folds, which are not repeated.

    Returns:
        The fits; None if the band consists of a single block, which no other line could predict.

    Raises:
        KeyboardInterrupt: interrupted; there is no held-out prediction then.
    """
    theta, parametrisation = full_fit.theta, full_fit.parametrisation
    width = block_width(model, theta, campaign.freq_hz) if width is None else width
    folds = assign_folds(len(campaign.freq_hz), width)
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
    return HeldOutFits(thetas, tuple(end.outcome for end in finished), folds, width)


def hold_out_lines(
    model: Model,
    campaign: Campaign,
    settled: Fit,
    schedule: FloorSchedule,
    *,
    width: int | None = None,
    jobs: int = 1,
    report: Callable[[int], None] | None = None,
    checkpoint: Checkpoint | None = None,
) -> HeldOutFits | None:
    """Fit all folds of the lines but one, for each fold, at the model error of a fit's residuals.

    These fits count twice as many lines as that fit.

    Args:
        model: machine and Parts.
        campaign: tests on the lines of the band.
        settled: fit to all folds at its own floor.
        schedule: schedule of that fit.
        width: number of lines in a block; by the fitted model's modes if None.
        jobs: threads; the result does not depend on it.
        report: called with the number of each finished fold.
        checkpoint: finished folds, which are not repeated.

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
        width=width,
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
