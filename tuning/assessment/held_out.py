"""Held-out lines: K-fold cross-validation with blocks from resonance to resonance.

Neighbouring lines within a resonance predict each other. Folds therefore consist of contiguous
blocks, which are assigned to five folds in turn (Roberts et al. 2017,
Ecography 40). The gap of these predictions is computed by ``tuning.assessment.gap``.

Blocks of frequency lines that are held out together: from resonance to resonance.

A block that holds a whole narrow mode asks for what no other line tells: where that mode lies. The
answer is wrong by many times the noise for right models and wrong ones alike. So a block ends at
the peak of each measured resonance: one flank of a mode then stands in the next fold, and what a
fit foretells is the other flank, and all that lies between two modes.

The blocks are those of the measurement, whatever is fitted: one scheme for all models of a
campaign.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from joblib import Parallel, delayed
from scipy.ndimage import uniform_filter1d
from threadpoolctl import threadpool_limits

from identification.words import Campaign, Complex, Integers, Mask, Real
from mbmodel import Model
from tuning.fitting.checkpoint import Checkpoint
from tuning.fitting.error_floor_fit import FloorSchedule
from tuning.fitting.fitter import Fit
from tuning.fitting.stage_search import LAST_STAGE, minimise_stage, thin_lines, thinning_slice
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


N_FOLDS = 5
MIN_BLOCK_LINES = 8  # any shape along frequency fits fewer
_BANDWIDTHS = 10  # of a block at most: further away, neighbours tell nothing of a resonance
_MIN_BLOCKS = 15  # three for each fold, so that no fold is all of one range
_HALF_POWER = 0.5  # by which a mode stands out
_NOISE_SIGMA = 4.5  # and from the noise: of 10,000 lines none does by chance
_ONE_MODE_LINES = 5  # within which channels show the peak of one and the same mode


def find_blocks(campaign: Campaign) -> Integers:
    """Return the first line of each block, in ascending order; (n_block,).

    Blocks begin at the peaks of the channels. Between them they are at most ten lower quartiles of
    the peaks' half-power bandwidths wide, and at most a fifteenth of the band, but no narrower than
    8 lines.

    Args:
        campaign: tests on the lines of the band.
    """
    peaks, bandwidth = _find_peaks(campaign)
    n_freq = len(campaign.freq_hz)
    width = max(min(n_freq // _MIN_BLOCKS, round(_BANDWIDTHS * bandwidth)), MIN_BLOCK_LINES)
    starts = [
        start
        for low, high in pairwise([0, *peaks.tolist(), n_freq])
        for start in np.linspace(low, high, _count_blocks(high - low, width), endpoint=False)
    ]
    return np.unique(np.round(starts).astype(np.intp))


def assign_folds(starts: Integers, n_freq: int) -> Integers:
    """Return the fold of each line, with block i in fold i mod 5; (n_freq,)."""
    return (np.searchsorted(starts, np.arange(n_freq), side="right") - 1) % N_FOLDS


def _count_blocks(lines: int, width: int) -> int:
    """Return the number of blocks of some lines, each as wide as allowed, or narrower."""
    return max(1, min(-(-lines // width), lines // MIN_BLOCK_LINES))


def _find_peaks(campaign: Campaign) -> tuple[Integers, float]:
    """Return the lines at which channels have peaks, and the lower quartile of their width [lines].

    In each channel a peak exceeds its surroundings by half its power, and by 4.5 standard
    deviations of the noise. Peaks of several channels within 5 lines are those of one mode. The
    width is that of the whole band if there is no peak.
    """
    from scipy.signal import find_peaks, peak_widths  # noqa: PLC0415  # slow to load

    n_freq = len(campaign.freq_hz)
    count, widths = np.zeros(n_freq), []
    for test in campaign.tests:
        measured = test.estimate.measured[:, 0]
        values = test.estimate.frf.values[:, measured, 0]
        for value, variance in zip(values.T, test.estimate.variance[:, measured, 0].T, strict=True):
            power = np.abs(value) ** 2
            noise = np.sqrt((2 * power + variance) * variance)  # of |H + n|^2, n circular
            prominence = np.maximum(_HALF_POWER * power, _NOISE_SIGMA * noise)
            peaks, _ = find_peaks(power, prominence=prominence)
            count[peaks] += 1
            widths.append(peak_widths(power, peaks, rel_height=_HALF_POWER)[0])
    seen = uniform_filter1d(count, _ONE_MODE_LINES, mode="constant")
    modes, _ = find_peaks(seen, distance=_ONE_MODE_LINES, prominence=_HALF_POWER * seen)
    all_widths = np.concatenate(widths) if widths else np.zeros(0)
    return modes, float(np.quantile(all_widths, 0.25)) if len(all_widths) else float(n_freq)
