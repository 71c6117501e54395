"""Held-out lines: blocks as wide as resonances, dealt to five folds."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from identification.words import Campaign, Complex, Integers, Mask, Real
from mbmodel import Model, modes_of_matrices
from tuning.fitting.checkpoint import Journal
from tuning.fitting.fitter import Fit, descend
from tuning.fitting.stages import LAST, counted_lines, thinned
from tuning.misfit.batch import predict
from tuning.misfit.normal_equations import Arrow
from tuning.solvers.nlopt_solver import Minimum, Outcome

FOLDS = 5
_LEAST = 8
_PROMISE = 1.0  # nats: of 1e5 that a campaign has, it moves no gap's fifth digit


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Fits that each left one fold of the lines out.

    Args:
        thetas: of each fold's fit, in SI; (n_fold, n_parameter), 5 folds unless blocks are fewer.
        outcomes: how each fold's search ended; n_fold.
        folds: fold of each line; (n_freq,).
        width: lines in a block.
    """

    thetas: Real
    outcomes: tuple[Outcome, ...]
    folds: Integers
    width: int

    def predict(self, model: Model, campaign: Campaign) -> tuple[Complex, ...]:
        """Each test's FRFs in its labels, each line by the fit that did not see it.

        Args:
            model: that was fitted.
            campaign: any channels on the lines of the fits.

        Returns:
            (n_freq, n_out, 1) each.
        """
        whole = [np.zeros_like(test.estimate.frf.values) for test in campaign.tests]
        for fold, theta in enumerate(self.thetas):
            held = self.folds == fold
            if held.any():
                for values, answer in zip(
                    whole, predict(model, theta, campaign.lines(held)), strict=True
                ):
                    values[held] = answer
        return tuple(whole)


def block_width(model: Model, theta: Real, freq_hz: Real) -> int:
    """Lines in a block: three lower quartiles of the modes' bandwidth 2 zeta f in the band.

    At least 8 lines and at most a fifteenth of the band; in a band of less than 120 lines the 8
    win. Without a mode in the band the blocks are as wide as they may.

    Args:
        model: the re-tuned model.
        theta: its parameters.
        freq_hz: lines of the band; (n_freq,).
    """
    found = modes_of_matrices(model.matrices(theta))
    inside = (found.freq_hz >= freq_hz[0]) & (found.freq_hz <= freq_hz[-1]) & (found.poles.imag > 0)
    most = len(freq_hz) // 15
    if not inside.any() or len(freq_hz) < 2:
        return max(_LEAST, most)
    bandwidth = np.quantile(2 * found.damping[inside] * found.freq_hz[inside], 0.25)
    spacing = (freq_hz[-1] - freq_hz[0]) / (len(freq_hz) - 1)
    return max(_LEAST, min(round(float(3 * bandwidth / spacing)), most))


def fold_of_lines(n_freq: int, width: int) -> Integers:
    """Block i belongs to fold i mod 5; (n_freq,)."""
    folds: Integers = (np.arange(n_freq) // width) % FOLDS
    return folds


def fit_held_out(
    model: Model,
    found: Fit,
    campaign: Campaign,
    *,
    jobs: int = 1,
    width: int | None = None,
    promise: float = _PROMISE,
    report: Callable[[int], None] | None = None,
    journal: Journal | None = None,
) -> HeldOut | None:
    """Leave out one fold of the lines after the other and fit the rest, started at a fit to all.

    A fit that counted every so manyth line leaves out folds of these; blocks are still those of
    all lines.

    Args:
        model: machine and Parts.
        found: the fit to all folds.
        campaign: the lines of the band.
        jobs: threads; the result does not depend on it.
        width: lines in a block; by the fitted model's modes if None.
        promise: nats that a further step may promise and is not made.
        report: told the number of each fold that is done.
        journal: knows finished folds, which are not made again.

    Returns:
        The fits; None if the band holds a single block, which nothing could predict.

    Raises:
        KeyboardInterrupt: interrupted; there is no held-out prediction then.
    """
    theta, varies = found.theta, found.freedom
    width = block_width(model, theta, campaign.freq_hz) if width is None else width
    folds = fold_of_lines(len(campaign.freq_hz), width)
    if not folds.any():
        return None
    journal = Journal() if journal is None else journal
    stage = found.last or LAST
    campaign, seen = thinned(campaign, stage.stride), folds[counted_lines(len(folds), stage.stride)]
    ends = {fold: journal.recall(f"fold {fold}") for fold in range(int(folds.max()) + 1)}
    missing = [fold for fold, end in ends.items() if end is None]
    normals = stage.normals(model, campaign, varies, found.x, seen, jobs) if missing else []
    work = (
        delayed(_fit_without)(model, campaign, found, seen != fold, normals[fold], promise)
        for fold in missing
    )
    with threadpool_limits(1):
        made = Parallel(n_jobs=jobs, prefer="threads", return_as="generator")(work)
        for fold, end in zip(missing, made, strict=True):
            journal.keep(f"fold {fold}", end)
            ends[fold] = end
            if report is not None:
                report(fold)
    known = [end for end in ends.values() if end is not None]
    thetas = np.array([varies.theta(end.x) for end in known])
    return HeldOut(thetas, tuple(end.outcome for end in known), folds, width)


def _fit_without(
    model: Model, campaign: Campaign, found: Fit, kept: Mask, normal: Arrow, promise: float
) -> Minimum:
    """The fit to the lines that are kept, from the one to all: mostly a single step."""
    stage = found.last or LAST
    problem = stage.problem(model, campaign, found.freedom, counted=kept)
    end = descend(problem, found.freedom, found.x, stage, known=normal, promise=promise)
    if end.outcome == "interrupted":
        raise KeyboardInterrupt
    return end
