"""Held-out lines: blocks as wide as resonances, dealt to five folds."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from identification.words import Campaign, Complex, Integers, Real
from mbmodel import Model, modes
from tuning.batch import predict
from tuning.fit import STAGES, Stage, fit

FOLDS = 5
_LEAST = 8
WARM_STAGES: tuple[Stage, ...] = STAGES[-2:]


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Predictions of lines that the fit behind them did not see.

    Args:
        predicted: each test's FRFs in its labels; (n_freq, n_out, 1) each.
        thetas: of each fold's fit, in SI; (5, n_parameter).
        folds: fold of each line; (n_freq,).
    """

    predicted: tuple[Complex, ...]
    thetas: Real
    folds: Integers


def block_width(model: Model, theta: Real, freq_hz: Real) -> int:
    """Lines in a block: three lower quartiles of the modes' bandwidth 2 zeta f in the band.

    At least 8 lines and at most a fifteenth of the band; in a band of less than 120 lines the 8
    win. Without a mode in the band the blocks are as wide as they may.

    Args:
        model: the re-tuned model.
        theta: its parameters.
        freq_hz: lines of the band; (n_freq,).
    """
    found = modes(model.matrices(theta))
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


def predict_held_out(
    model: Model,
    theta: Real,
    campaign: Campaign,
    *,
    track: Callable[[Iterable[int]], Iterable[int]] = iter,
) -> HeldOut:
    """Predict every line by a fit to the other folds' lines, started at theta.

    Args:
        model: machine and Parts.
        theta: fitted to all lines; (n_parameter,).
        campaign: the lines of the band.
        track: wraps the loop over folds, to show progress.
    """
    folds = fold_of_lines(len(campaign.freq_hz), block_width(model, theta, campaign.freq_hz))
    predicted = [np.zeros_like(test.estimate.frf.values) for test in campaign.tests]
    thetas = np.tile(theta, (FOLDS, 1))
    for fold in track(range(FOLDS)):
        held = folds == fold
        if not held.any():
            continue
        tuned = fit(model, campaign.lines(~held), starts=(theta,), stages=WARM_STAGES)
        if tuned.outcome == "interrupted":
            raise KeyboardInterrupt
        thetas[fold] = tuned.theta
        answers = predict(model, tuned.theta, campaign.lines(held))
        for whole, answer in zip(predicted, answers, strict=True):
            whole[held] = answer
    return HeldOut(tuple(predicted), thetas, folds)
