"""Gap between a fit and the measurement, on held-out lines.

Delete-group jackknife: intervals from values without one group of the data each.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import stdtrit

from diagnosis.estimates.intervals import FittedParameters, fit_parameters
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.null_model import Baseline, fit_null_model
from diagnosis.refits.refit import Refit
from diagnosis.refits.refitting import RefitTask, add_hypotheses, find_start, run_refits
from diagnosis.settings import DiagnosisSettings
from identification.words import Campaign, Complex, Integers, Mask, Real
from tuning import (
    ChannelGaps,
    Gap,
    HeldOutFits,
    Session,
    channel_gaps,
    hold_out_lines,
    predict,
    summarise_gaps,
)
from tuning.workers.independent_calls import Call, run_in_parallel


@dataclass(frozen=True, eq=False)
class HeldOutGap:
    """Gap between a fit and the measurement.

    Args:
        refit: fit to all folds.
        held_out: fits with one fold left out each; None if the band is too narrow.
        predicted: FRFs, each line by a fit without its fold, or by the fit if there are no folds.
        campaign: measured FRFs.
    """

    refit: Refit
    held_out: HeldOutFits | None
    predicted: tuple[Complex, ...]
    campaign: Campaign

    @cached_property
    def channels(self) -> ChannelGaps:
        """Gap of each channel."""
        return channel_gaps(self.predicted, self.campaign)

    @cached_property
    def gap(self) -> Gap:
        """Gap on held-out lines, or on all lines if there are none."""
        return summarise_gaps(self.channels)

    @property
    def starts(self) -> Integers:
        """First line of each block; (n_block,), the first line alone without held-out lines."""
        return np.zeros(1, np.intp) if self.held_out is None else self.held_out.starts

    @property
    def theta(self) -> Real:
        """Mean parameters of the fits without a fold, each to most of the lines; (n_parameter,)."""
        held = self.held_out
        return self.refit.fit.theta if held is None else held.thetas.mean(axis=0)

    @property
    def unfinished(self) -> int:
        """Number of fits without a fold that did not converge."""
        held = self.held_out
        return 0 if held is None else sum(outcome != "converged" for outcome in held.outcomes)

    def excess_interval(self) -> tuple[float, float] | None:
        """Return the 95 % interval of the excess; None without held-out lines."""
        if self.held_out is None:
            return None
        folds = self.held_out.folds
        without = [self.select_lines(folds != fold).excess for fold in range(int(folds.max()) + 1)]
        return estimate_size_jackknife(self.gap.excess, without)

    def select_lines(self, lines: Mask) -> Gap:
        """Return the gap on some lines; (n_freq,)."""
        return summarise_gaps(
            channel_gaps(
                [values[lines] for values in self.predicted], self.campaign.select_lines(lines)
            )
        )


@dataclass(frozen=True, eq=False)
class GapEstimates:
    """Gap without and with the causes, and the parameters of the causes.

    Args:
        retuned: gap of the null model.
        after: gap with all causes; None without a cause.
        parameters: parameters of the fit with all causes; None without a cause.
        corrected: gap of the null model where the proven faults are corrected, beside further
            causes; None without such causes, or without proven faults.
    """

    retuned: HeldOutGap
    after: HeldOutGap | None
    parameters: FittedParameters | None
    corrected: HeldOutGap | None = None


def fit_whole_null(base: Baseline, whole: Session, null: Refit) -> Refit:
    """Return the null model of all channels: the given one, unless some were left out of it.

    Args:
        whole: session with all channels.
        null: null model without the channels of gross faults.
    """
    if _has_all_channels(base, whole):
        return null
    return fit_null_model(replace(base.scene, session=whole), base.scene.settings)


def _has_all_channels(base: Baseline, whole: Session) -> bool:
    """Return whether the fits count all channels as they were measured."""
    return not base.proven and whole.campaign is base.scene.session.campaign


def estimate_gaps(
    base: Baseline, whole: Session, null: Refit, best: Refit, settings: DiagnosisSettings
) -> GapEstimates:
    """Estimate the gap of the null model and of the model with all causes.

    Args:
        whole: session with all channels.
        null: null model of all channels (``fit_whole_null``).
        best: most probable set of causes.
    """
    scene, last = base.scene, best
    if not _has_all_channels(base, whole):
        last = _refit_whole(scene, whole, best, base.proven, settings) or null
    if not last.causes:
        return GapEstimates(hold_out(scene, null), None, None)
    factor, settings = scene.stride_factor, scene.settings
    first_alone, last_alone = (replace(refit, causes=()) for refit in (null, last))
    calls: list[Call] = [
        (_fit_folds, (last_alone, factor, settings)),
        (fit_parameters, (last_alone, factor, settings)),
        (_fit_folds, (first_alone, factor, settings)),
    ]
    after, parameters, retuned = run_in_parallel(calls, scene.jobs)
    return GapEstimates(_describe_gap(null, retuned), _describe_gap(last, after), parameters)


def hold_out(scene: Scene, refit: Refit) -> HeldOutGap:
    """Return the held-out gap of a refit.

    Args:
        scene: thinning of the lines, and settings.
    """
    return _describe_gap(refit, _fit_folds(refit, scene.stride_factor, scene.settings))


def _refit_whole(
    scene: Scene,
    whole: Session,
    best: Refit,
    proven: tuple[Hypothesis, ...],
    settings: DiagnosisSettings,
) -> Refit | None:
    """Refit causes and proven faults to all channels, from the fit without the useless ones.

    There is nothing to refit without a cause that the model can have.
    """
    causes = (*(cause for cause in proven if cause.is_modelled), *best.causes)
    if not causes:
        return None
    whole = replace(whole, parametrisation=scene.session.parametrisation)
    session = add_hypotheses(whole, *causes)
    task = RefitTask(causes, session, find_start(best, session, *proven), best.floor)
    (refit,) = run_refits(scene, [task], settings.schedule)
    return refit


def _fit_folds(refit: Refit, stride_factor: int, settings: DiagnosisSettings) -> HeldOutFits | None:
    """Fit all folds of the lines but one, for each fold, at the model error of the refit."""
    model, campaign = refit.session.model, refit.session.campaign
    schedule = settings.schedule.thin(len(campaign.freq_hz), stride_factor)
    return hold_out_lines(model, campaign, refit.fit, schedule)


def _describe_gap(refit: Refit, held: HeldOutFits | None) -> HeldOutGap:
    session = refit.session
    predicted = (
        predict(session.model, refit.fit.theta, session.campaign)
        if held is None
        else held.predict(session.model, session.campaign)
    )
    return HeldOutGap(refit, held, predicted, session.campaign)


def estimate_jackknife(
    whole: float | None, without: list[float | None]
) -> tuple[float, float] | None:
    """Return the 95 % interval of a number, by Student's t with the number of groups less one.

    Args:
        whole: value from all groups.
        without: values without one group each.

    Returns:
        Both ends; None if a value is unknown.
    """
    values: Real = np.array([value for value in without if value is not None])
    count = len(without)
    if whole is None or count < 2 or len(values) < count:
        return None
    deviation = np.sqrt((count - 1) / count * ((values - values.mean()) ** 2).sum())
    half = float(stdtrit(count - 1, 0.975) * deviation)
    return whole - half, whole + half


def estimate_size_jackknife(
    whole: float | None, without: list[float | None]
) -> tuple[float, float] | None:
    """Return the jackknife interval of a positive number, by its logarithm."""
    if not whole or not all(without):
        return None
    spread = estimate_jackknife(
        float(np.log(whole)), [None if value is None else float(np.log(value)) for value in without]
    )
    return None if spread is None else (float(np.exp(spread[0])), float(np.exp(spread[1])))
