"""Tuning as a whole: fit, held-out fits, and the gap at the sensors and at the bodies."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from identification.words import Campaign, Complex, ModalModel, Real
from mbmodel import Model
from tuning.assessment.frf_bands import magnitude_deviations
from tuning.assessment.gap import (
    ChannelGaps,
    Gap,
    answers_at_bodies,
    at_bodies,
    channel_gaps,
    summarise,
)
from tuning.assessment.held_out import HeldOut, fit_held_out
from tuning.assessment.parameter_confidence import PLAUSIBLE, Confidence, confidence
from tuning.assessment.test_information import information
from tuning.files.schema import GainRow, Place, Residual
from tuning.fitting.checkpoint import Journal
from tuning.fitting.fitter import GAUSS_NEWTON, Fit, Progress, fit, random_starts
from tuning.fitting.stages import LAST, STAGES, Stage
from tuning.misfit.batch import predict
from tuning.misfit.modal_misfit import MODAL_STAGES, ModalStage
from tuning.session import Session


@dataclass(frozen=True, eq=False)
class Comparison:
    """Model beside measurement, at the sensors or at the centres of mass.

    Args:
        campaign: the measurement.
        as_drawn: the model's answers to each test, as drawn; (n_freq, n_out, 1) each.
        tuned: the same, of the tuned model.
        bounded: the same, fitted with every tolerance within its bounds: what the gap is of.
        deviation: standard deviation of the tuned model's magnitudes; None if interrupted.
        held_out: the same, each line by a fit that did not see it; None if interrupted.
    """

    campaign: Campaign
    as_drawn: tuple[Complex, ...]
    tuned: tuple[Complex, ...]
    bounded: tuple[Complex, ...]
    deviation: tuple[Real, ...] | None
    held_out: tuple[Complex, ...] | None

    def gap(self, predicted: tuple[Complex, ...]) -> Gap:
        """Sum up the gap of predictions."""
        return summarise(self.channels(predicted))

    def channels(self, predicted: tuple[Complex, ...]) -> ChannelGaps:
        """The gap of each channel."""
        return channel_gaps(predicted, self.campaign)


@dataclass(frozen=True, eq=False)
class Tuned:
    """Everything that a tuning found.

    Args:
        session: campaign and drawn model.
        fit: to all lines, tolerances within their bounds: what it leaves is the gap.
        free: the same without these bounds; ``fit`` itself if it reached none.
        sure: what the tuned model is worth; None if interrupted before.
        held_out: fits that left lines out; None if interrupted, if the band is too narrow, or if
            modes were fitted last, which know all lines.
        interrupted: whether fit or held-out fits were.
        sensors: at the measured channels.
        bodies: at the centres of mass.
        residuals: what was minimised, in order.
        measured: modes inside the band, if any were asked for.
        algorithm: of the first stages.
        at: where FRFs counted.
        gains: what further measurements would tell, if that was asked for.
    """

    session: Session
    fit: Fit
    free: Fit
    sure: Confidence | None
    held_out: HeldOut | None
    interrupted: bool
    sensors: Comparison
    bodies: Comparison
    residuals: tuple[Residual, ...] = ("log",)
    measured: ModalModel | None = None
    algorithm: str = GAUSS_NEWTON
    at: Place = "sensors"
    gains: tuple[GainRow, ...] = ()

    @property
    def model_fit(self) -> Fit:
        """The fit whose parameters are reported: without bounds, unless that hides a fault."""
        return choose(self.fit, self.free)


def choose(bounded: Fit, free: Fit) -> Fit:
    """The fit without bounds on tolerances if these explain it, else the one within them.

    Among hundreds of tolerances some are beyond 2.5 standard deviations, and a bound there shifts
    all else: intervals hold without it. A pull above 4.5 is a fault, which the tolerance must not
    swallow.
    """
    x = free.x[free.freedom.has_prior]
    plausible = float(np.abs(x).max(initial=0.0)) <= PLAUSIBLE
    return free if plausible and free.converged else bounded


@dataclass(frozen=True)
class Watch:
    """Who is told how a tuning goes on.

    Args:
        evaluated: about each evaluation of the first fit.
        folded: about each held-out fit.
    """

    evaluated: Callable[[Progress], None] | None = None
    folded: Callable[[int], None] | None = None


def stages_of(
    residuals: tuple[Residual, ...], at: Place = "sensors"
) -> tuple[Stage | ModalStage, ...]:
    """The stages of some residuals, in their order; after modes, FRFs need no first one.

    Args:
        residuals: what to minimise.
        at: where FRFs count; logarithms of the first stages always at the channels.
    """
    stages = tuple(
        replace(stage, at_bodies=at == "bodies" and not stage.logarithmic) for stage in STAGES
    )
    if residuals == ("log",):
        return stages
    return (*MODAL_STAGES, *stages[1:]) if "log" in residuals else MODAL_STAGES


def tune(  # noqa: PLR0913  # one for each option
    session: Session,
    *,
    residuals: tuple[Residual, ...] = ("log",),
    measured: ModalModel | None = None,
    algorithm: str = GAUSS_NEWTON,
    at: Place = "sensors",
    starts: int = 1,
    seed: int = 0,
    jobs: int = 1,
    inform: bool = False,
    watch: Watch | None = None,
    journal: Journal | None = None,
) -> Tuned:
    """Tune all that varies, say how sure it is, and what gap remains on held-out lines.

    Args:
        session: campaign and drawn model.
        residuals: what to minimise, in order: ``modal``, frequencies, damping ratios and shapes;
            ``log``, the logarithm of the FRFs' ratio.
        measured: modes inside the band; only reported where they are no residual.
        algorithm: of NLopt, by name, for the first stages; Gauss-Newton by default.
        at: where FRFs count: at the channels, or at the centres of mass with the covariance of
            their reduction.
        starts: how many starts: the drawing, then factors exp(N(0, 0.5)) on it.
        seed: of the random starts.
        jobs: processes for starts and held-out fits.
        inform: whether to say which further measurement would tell most.
        watch: who is told.
        journal: knows finished steps, which are not made again.

    Returns:
        The tuning; interrupted, the best so far without held-out predictions.

    Raises:
        UsageError: ``modal`` without a measured mode.
    """
    watch = watch or Watch()
    model, campaign = session.model, session.campaign
    found = fit(
        model,
        campaign,
        varies=session.freedom,
        starts=random_starts(model, starts, seed, varies=session.freedom),
        stages=stages_of(residuals, at),
        measured=measured,
        algorithm=algorithm,
        jobs=jobs,
        report=watch.evaluated,
        journal=journal,
    )
    free, sure, held_out = found, None, None
    interrupted = found.outcome == "interrupted"
    if not interrupted and residuals[-1] == "log":
        try:
            free = without_bounds(model, campaign, found, jobs, journal)
            sure = confidence(model, campaign, choose(found, free), jobs)
        except KeyboardInterrupt:
            interrupted = True
    if not interrupted and residuals[-1] == "log":
        try:
            held_out = fit_held_out(
                model, found, campaign, jobs=jobs, report=watch.folded, journal=journal
            )
        except KeyboardInterrupt:
            interrupted = True
    gains: tuple[GainRow, ...] = ()
    try:
        sensors, bodies = _at_both(model, campaign, (found, free), sure, held_out)
        if inform and sure is not None:
            gains = information(session, sure)
    except KeyboardInterrupt:
        interrupted = True
        sensors, bodies = _at_both(model, campaign, (found, free), None, held_out)
    return Tuned(
        session=session,
        fit=found,
        free=free,
        sure=sure,
        held_out=held_out,
        interrupted=interrupted,
        sensors=sensors,
        bodies=bodies,
        residuals=residuals,
        measured=measured,
        algorithm=algorithm,
        at=at,
        gains=gains,
    )


def without_bounds(
    model: Model, campaign: Campaign, found: Fit, jobs: int = 1, journal: Journal | None = None
) -> Fit:
    """The same fit, tolerances free to go beyond 2.5 standard deviations.

    Raises:
        KeyboardInterrupt: interrupted.
    """
    varies = found.freedom
    if not (varies.has_prior & varies.reached(found.x)).any():
        return found
    free = fit(
        model,
        campaign,
        varies=varies.unbounded(),
        starts=(found.theta,),
        stages=(found.last or LAST,),
        jobs=jobs,
        journal=journal,
        name="without bounds",
    )
    if free.outcome == "interrupted":
        raise KeyboardInterrupt
    return free


def _at_both(
    model: Model,
    campaign: Campaign,
    fits: tuple[Fit, Fit],
    sure: Confidence | None,
    held_out: HeldOut | None,
) -> tuple[Comparison, Comparison]:
    """At the sensors and at the centres of mass."""
    sensors = _compare(model, fits, sure, held_out, campaign)
    reduced = at_bodies(campaign)
    bodies = Comparison(
        reduced,
        as_drawn=answers_at_bodies(sensors.as_drawn, campaign),
        tuned=answers_at_bodies(sensors.tuned, campaign),
        bounded=answers_at_bodies(sensors.bounded, campaign),
        deviation=None if sure is None else magnitude_deviations(model, sure, reduced),
        held_out=None
        if sensors.held_out is None
        else answers_at_bodies(sensors.held_out, campaign),
    )
    return sensors, bodies


def _compare(
    model: Model,
    fits: tuple[Fit, Fit],
    sure: Confidence | None,
    held_out: HeldOut | None,
    campaign: Campaign,
) -> Comparison:
    bounded = predict(model, fits[0].theta, campaign)
    chosen = choose(*fits)
    return Comparison(
        campaign,
        as_drawn=predict(model, model.drawn, campaign),
        tuned=bounded if chosen is fits[0] else predict(model, chosen.theta, campaign),
        bounded=bounded,
        deviation=None if sure is None else magnitude_deviations(model, sure, campaign),
        held_out=held_out.predict(model, campaign) if held_out else None,
    )
