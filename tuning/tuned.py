"""Tuning as a whole: fit, held-out fits, and the gap at the sensors and at the bodies."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from identification import reduce_to_bodies
from identification.words import Campaign, Complex, ModalModel, Real
from mbmodel import Model
from tuning.batch import predict
from tuning.fit import STAGES, Fit, Progress, Stage, fit, random_starts
from tuning.folds import HeldOut, fit_held_out
from tuning.gap import ChannelGaps, Gap, channel_gaps, summarise
from tuning.modal import MODAL_STAGES, ModalStage
from tuning.schema import Residual
from tuning.session import Session


@dataclass(frozen=True, eq=False)
class Comparison:
    """Model beside measurement, at the sensors or at the centres of mass.

    Args:
        campaign: the measurement.
        as_drawn: the model's answers to each test, as drawn; (n_freq, n_out, 1) each.
        tuned: the same, fitted to all lines.
        held_out: the same, each line by a fit that did not see it; None if interrupted.
    """

    campaign: Campaign
    as_drawn: tuple[Complex, ...]
    tuned: tuple[Complex, ...]
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
        fit: to all lines.
        held_out: fits that left lines out; None if interrupted, if the band is too narrow, or if
            modes were fitted last, which know all lines.
        interrupted: whether fit or held-out fits were.
        sensors: at the measured channels.
        bodies: at the centres of mass.
        residuals: what was minimised, in order.
        measured: modes inside the band, if any were asked for.
    """

    session: Session
    fit: Fit
    held_out: HeldOut | None
    interrupted: bool
    sensors: Comparison
    bodies: Comparison
    residuals: tuple[Residual, ...] = ("log",)
    measured: ModalModel | None = None


@dataclass(frozen=True)
class Watch:
    """Who is told how a tuning goes on.

    Args:
        evaluated: about each evaluation of the first fit.
        folded: about each held-out fit.
    """

    evaluated: Callable[[Progress], None] | None = None
    folded: Callable[[int], None] | None = None


def stages_of(residuals: tuple[Residual, ...]) -> tuple[Stage | ModalStage, ...]:
    """The stages of some residuals, in their order; after modes, FRFs need no first one."""
    if residuals == ("log",):
        return STAGES
    return (*MODAL_STAGES, *STAGES[1:]) if "log" in residuals else MODAL_STAGES


def tune(
    session: Session,
    *,
    residuals: tuple[Residual, ...] = ("log",),
    measured: ModalModel | None = None,
    starts: int = 1,
    seed: int = 0,
    jobs: int = 1,
    watch: Watch | None = None,
) -> Tuned:
    """Tune stiffness and damping, and measure what gap remains on held-out lines.

    Args:
        session: campaign and drawn model.
        residuals: what to minimise, in order: ``modal``, frequencies, damping ratios and shapes;
            ``log``, the logarithm of the FRFs' ratio.
        measured: modes inside the band; only reported where they are no residual.
        starts: how many starts: the drawing, then factors exp(N(0, 0.5)) on it.
        seed: of the random starts.
        jobs: processes for the held-out fits.
        watch: who is told.

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
        starts=random_starts(model, starts, seed),
        stages=stages_of(residuals),
        measured=measured,
        report=watch.evaluated,
    )
    held_out = None
    interrupted = found.outcome == "interrupted"
    if not interrupted and residuals[-1] == "log":
        try:
            held_out = fit_held_out(model, found.theta, campaign, jobs=jobs, report=watch.folded)
        except KeyboardInterrupt:
            interrupted = True
    sensors, bodies = (
        _compare(model, found.theta, held_out, measured)
        for measured in (campaign, at_bodies(campaign))
    )
    return Tuned(session, found, held_out, interrupted, sensors, bodies, residuals, measured)


def _compare(model: Model, theta: Real, held_out: HeldOut | None, campaign: Campaign) -> Comparison:
    return Comparison(
        campaign,
        as_drawn=predict(model, model.drawn, campaign),
        tuned=predict(model, theta, campaign),
        held_out=held_out.predict(model, campaign) if held_out else None,
    )


def at_bodies(campaign: Campaign) -> Campaign:
    """The same tests, reduced to the centres of mass (seed, eq. 2.5)."""
    tests = tuple(
        replace(test, estimate=reduce_to_bodies(test.estimate, campaign.layout))
        for test in campaign.tests
    )
    return replace(campaign, tests=tests)
