"""How far a fit is from what was measured, on lines that it did not see."""

from dataclasses import dataclass, replace
from functools import cached_property

from diagnosis.estimates.intervals import FittedParameters, fit_parameters
from diagnosis.estimates.jackknife import estimate_size_jackknife
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.hypothesis_set import join_hypotheses
from diagnosis.null_model import Baseline
from diagnosis.refits.measured import choose_stride
from diagnosis.refits.parallel import Call, run_in_parallel
from diagnosis.refits.refit import Refit
from diagnosis.refits.refitting import RefitTask, add_hypothesis, run_refits, start_values
from diagnosis.settings import DiagnosisSettings
from identification.words import Campaign, Complex, Mask, Real
from tuning import (
    STAGES,
    ChannelGaps,
    Gap,
    HeldOutFits,
    Session,
    Stage,
    block_width,
    channel_gaps,
    fit_held_out,
    predict,
    summarise_gaps,
)

_MIN_STATED_GAIN_NATS = 0.1  # of a further step, in fits whose parameters are stated


@dataclass(frozen=True, eq=False)
class HeldOutGap:
    """A fit, and how far it is from what was measured.

    Args:
        refit: of all folds.
        held_out: with folds left out; None if the band is too narrow.
        predicted: each line by a fit that did not see it, or by the fit if there are no folds.
        campaign: what it is compared with.
    """

    refit: Refit
    held_out: HeldOutFits | None
    predicted: tuple[Complex, ...]
    campaign: Campaign

    @cached_property
    def channels(self) -> ChannelGaps:
        """The gap of each channel."""
        return channel_gaps(self.predicted, self.campaign)

    @cached_property
    def gap(self) -> Gap:
        """On held-out lines, or on all if there are none."""
        return summarise_gaps(self.channels)

    @property
    def width(self) -> int | None:
        """Lines in a block; None without held-out lines."""
        return None if self.held_out is None else self.held_out.width

    @property
    def theta(self) -> Real:
        """The mean of the fits without a fold, for each saw most of the lines; (n_parameter,)."""
        held = self.held_out
        mean: Real = self.refit.fit.theta if held is None else held.thetas.mean(axis=0)
        return mean

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
    """The gap before and after, and the parameters of the causes.

    Args:
        retuned: the null model.
        after: with all causes; None without one.
        parameters: the parameters of that fit; None without a cause that a model holds.
    """

    retuned: HeldOutGap
    after: HeldOutGap | None
    parameters: FittedParameters | None


def estimate_gaps(
    base: Baseline, whole: Session, null: Refit, best: Refit, settings: DiagnosisSettings
) -> GapEstimates:
    """Estimate the gap of the null model and of the model with all causes.

    Args:
        base: scene of the fits, and what redundant channels prove.
        whole: session with all channels.
        null: null model.
        best: most probable set of causes.
        settings: schedule of the refits.
    """
    scene, first, last = base.scene, null, best
    if base.proven or whole.campaign is not scene.session.campaign:
        first, last = _refit_whole(scene, whole, (null, best), base.proven, settings)
    width = block_width(first.session.model, first.fit.theta, whole.campaign.freq_hz)
    if not last.causes:
        return GapEstimates(hold_out(scene, first, width), None, None)
    calls: list[Call] = [
        (_held_out_fits, (replace(last, hypothesis=None), scene.stride_factor, width)),
        (fit_parameters, (replace(last, hypothesis=None), scene.stride_factor)),
        (_held_out_fits, (replace(first, hypothesis=None), scene.stride_factor, width)),
    ]
    after, parameters, retuned = run_in_parallel(calls, scene.jobs)
    return GapEstimates(_gap(first, retuned), _gap(last, after), parameters)


def hold_out(scene: Scene, refit: Refit, width: int | None) -> HeldOutGap:
    """Return the held-out gap of a refit; blocks are those of its own model if no width is given.

    Args:
        scene: thinning of the lines.
        refit: the refit.
        width: lines in a block.
    """
    return _gap(refit, _held_out_fits(refit, scene.stride_factor, width))


def _refit_whole(
    scene: Scene,
    whole: Session,
    fits: tuple[Refit, Refit],
    proven: tuple[Hypothesis, ...],
    settings: DiagnosisSettings,
) -> tuple[Refit, Refit]:
    """Refit null model and causes to all channels, from where the fits without some ended."""
    null, best = fits
    causes = (*(cause for cause in proven if cause.is_modelled), *best.causes)
    tasks = [RefitTask(None, whole, start_values(null, whole, None), null.floor)]
    if causes:
        joined = join_hypotheses(causes)
        session = add_hypothesis(whole, joined)
        new = join_hypotheses(proven) if proven else None
        tasks.append(RefitTask(joined, session, start_values(best, session, new), best.floor))
    refits = run_refits(scene, tasks, settings.schedule)
    return refits[0], refits[-1]


def _held_out_fits(refit: Refit, pace: int, width: int | None) -> HeldOutFits | None:
    """Fit all folds of the lines but one, for each fold, at the refit's model-error floor."""
    session = refit.session
    stride = choose_stride(len(session.campaign.freq_hz), 8 * pace) // 2
    stage: Stage = replace(
        STAGES[4], model_error_floor=refit.floor, stride=stride, tolerance=1e-3, max_steps=6
    )
    full_fit = replace(refit.fit, last_stage=stage)
    return fit_held_out(
        session.model,
        full_fit,
        session.campaign,
        width=width,
        min_gain_nats=_MIN_STATED_GAIN_NATS,
    )


def _gap(refit: Refit, held: HeldOutFits | None) -> HeldOutGap:
    session = refit.session
    predicted = (
        predict(session.model, refit.fit.theta, session.campaign)
        if held is None
        else held.predict(session.model, session.campaign)
    )
    return HeldOutGap(refit, held, predicted, session.campaign)
