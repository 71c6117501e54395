"""Tuning of a campaign: fit, held-out fits, intervals and predictions at sensors and bodies.

The gap of these predictions is computed by ``tuning.assessment.gap`` (``Comparison.gap``).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from identification import find_overstated_noise, remove_overstated_noise
from identification.words import Campaign, Complex, ModalModel, Real
from mbmodel import Model
from tuning.assessment.findings import GainRow
from tuning.assessment.frf_bands import magnitude_deviations
from tuning.assessment.further_tests import rank_further_tests
from tuning.assessment.gap import (
    ChannelGaps,
    Gap,
    channel_gaps,
    reduce_answers_to_bodies,
    reduce_campaign_to_bodies,
    summarise_gaps,
)
from tuning.assessment.held_out import HeldOutFits, hold_out_lines
from tuning.assessment.parameter_confidence import ParameterConfidence, estimate_confidence
from tuning.assessment.plant_confidence import PlantConfidence, estimate_plant_confidence
from tuning.fitting.checkpoint import Checkpoint
from tuning.fitting.error_floor_fit import FloorSchedule
from tuning.fitting.fitter import Fit, FitProgress, fit
from tuning.fitting.machine_fit import (
    FIRST_STAGES,
    PLAUSIBLE_PULL_SIGMA,
    count_starts,
    fit_all_lines,
    fit_first_stages,
    settle_floor,
)
from tuning.fitting.stage_search import LAST_STAGE, Stage
from tuning.misfit.batch import predict
from tuning.misfit.modal_misfit import MODAL_STAGES, ModalStage
from tuning.session import Session
from tuning.solvers.nlopt_solver import INTERRUPTED_ADVICE, TUNING_ALGORITHM

ResidualKind = Literal["modal", "log"]
FrfPlace = Literal["sensors", "bodies"]


@dataclass(frozen=True, eq=False)
class Comparison:
    """Model beside measurement, at the sensors or at the centres of mass.

    Args:
        campaign: measurements.
        as_drawn: answers of the nominal model to each test; (n_freq, n_out, 1) each.
        tuned: answers of the tuned model; (n_freq, n_out, 1) each.
        bounded: answers of the fit with all tolerances within their bounds, to which the gap
            refers; (n_freq, n_out, 1) each.
        deviation: standard deviation of the tuned model's magnitudes; None if interrupted.
        held_out: answers of the fits that left each line out; None if interrupted.
    """

    campaign: Campaign
    as_drawn: tuple[Complex, ...]
    tuned: tuple[Complex, ...]
    bounded: tuple[Complex, ...]
    deviation: tuple[Real, ...] | None
    held_out: tuple[Complex, ...] | None

    def gap(self, predicted: tuple[Complex, ...]) -> Gap:
        """Return the gap of predictions."""
        return summarise_gaps(self.channels(predicted))

    def channels(self, predicted: tuple[Complex, ...]) -> ChannelGaps:
        """Return the gap of each channel."""
        return channel_gaps(predicted, self.campaign)


@dataclass(frozen=True, eq=False)
class CampaignTuning:
    """A tuning with everything that was computed from it.

    Args:
        session: campaign and nominal model.
        fit: fit to all lines with tolerances within their bounds, whose misfit is the gap.
        unbounded_fit: fit without these bounds; equal to ``fit`` if that is at no bound.
        confidence: confidence in the parameters; None if interrupted before.
        plant: confidence in the machine between any ports; None if interrupted before.
        held_out: fits that left lines out; None if interrupted, if the band is too narrow, or if
            modes were fitted last, which depend on all lines.
        interrupted: whether fit or held-out fits were interrupted.
        sensors: comparison at the measured channels.
        bodies: comparison at the centres of mass.
        residuals: residuals that were minimised, in order.
        measured_modes: modes inside the band, if requested.
        algorithm: algorithm of the stages in which stiffness and damping alone vary.
        at: where FRFs counted.
        gains: information of further measurements, if requested.
    """

    session: Session
    fit: Fit
    unbounded_fit: Fit
    confidence: ParameterConfidence | None
    plant: PlantConfidence | None
    held_out: HeldOutFits | None
    interrupted: bool
    sensors: Comparison
    bodies: Comparison
    residuals: tuple[ResidualKind, ...] = ("log",)
    measured_modes: ModalModel | None = None
    algorithm: str = TUNING_ALGORITHM
    at: FrfPlace = "sensors"
    gains: tuple[GainRow, ...] = ()

    def __repr__(self) -> str:
        """Return campaign, machine, outcome and number of parameters in one line."""
        return (
            f"tuning of {self.session.model.machine.name} to {self.session.campaign.name}: "
            f"{self.fit.outcome}, {self.fit.parametrisation.size} parameters"
        )

    @property
    def model_fit(self) -> Fit:
        """Fit whose parameters are reported: the unbounded one, unless that hides a fault."""
        return choose_fit(self.fit, self.unbounded_fit)


def choose_fit(bounded: Fit, unbounded: Fit) -> Fit:
    """Return the fit without bounds on tolerances if its pulls are plausible, else the bounded one.

    Among hundreds of tolerances some exceed 2.5 standard deviations by chance. A bound there biases
    all other parameters, so that intervals are valid without it only. A pull above 4.5 is a fault,
    which the tolerance must not absorb.
    """
    pulls = unbounded.x[unbounded.parametrisation.is_tolerance]
    is_plausible = float(np.abs(pulls).max(initial=0.0)) <= PLAUSIBLE_PULL_SIGMA
    return unbounded if is_plausible and unbounded.converged else bounded


@dataclass(frozen=True)
class ProgressCallbacks:
    """Callbacks for the progress of a tuning.

    Args:
        on_evaluation: called at each evaluation of the first fit.
        on_fold: called after each held-out fit.
    """

    on_evaluation: Callable[[FitProgress], None] | None = None
    on_fold: Callable[[int], None] | None = None


def select_stages(residuals: tuple[ResidualKind, ...]) -> tuple[Stage | ModalStage, ...]:
    """Return the first stages of some residuals, in their order.

    After modes, the first FRF stage is left out.

    Args:
        residuals: residuals to minimise.
    """
    if residuals == ("log",):
        return FIRST_STAGES
    return (*MODAL_STAGES, *FIRST_STAGES[1:]) if "log" in residuals else MODAL_STAGES


def tune(  # noqa: PLR0913  # one for each option
    session: Session,
    *,
    residuals: tuple[ResidualKind, ...] = ("log",),
    measured: ModalModel | None = None,
    algorithm: str = TUNING_ALGORITHM,
    at: FrfPlace = "sensors",
    starts: int = 1,
    seed: int = 0,
    jobs: int = 1,
    inform: bool = False,
    callbacks: ProgressCallbacks | None = None,
    checkpoint: Checkpoint | None = None,
) -> CampaignTuning:
    """Tune all parameters that vary; compute their intervals and the gap on held-out lines.

    Args:
        residuals: residuals to minimise, in order: ``modal`` (frequencies, damping ratios and
            shapes), ``log`` (FRFs, first by the logarithm of their ratio).
        measured: modes inside the band; only reported if ``modal`` is not a residual.
        algorithm: name of an algorithm of NLopt, or ``GAUSS_NEWTON``, for stages in which
            stiffness and damping alone vary.
        at: where FRFs count: at the channels, or at the centres of mass with the covariance of
            their reduction.
        starts: number of starts: the nominal model, then random factors exp(N(0, 0.5)) on it.
        jobs: processes for starts and held-out fits.
        inform: whether to compute which further measurement would be most informative.
        callbacks: callbacks for the progress.

    Returns:
        The tuning; if interrupted, the best parameters so far without held-out predictions.

    Raises:
        UsageError: ``modal`` without a measured mode.
    """
    callbacks = callbacks or ProgressCallbacks()
    model, given = session.model, session.campaign
    campaign = remove_overstated_noise(given, find_overstated_noise(given))
    session = replace(session, campaign=campaign)
    usual = FloorSchedule(at_bodies=at == "bodies")
    schedule = usual.thin(len(campaign.freq_hz), usual.find_stride_factor(campaign))
    has_frfs, stages = residuals[-1] == "log", select_stages(residuals)
    starts = count_starts(campaign, starts) if has_frfs else starts

    def report_last(step: FitProgress) -> None:
        if callbacks.on_evaluation is not None:
            callbacks.on_evaluation(replace(step, start=starts - 1, stage=len(stages)))

    bounded = settled = fit_first_stages(
        model,
        campaign,
        session.parametrisation,
        schedule,
        stages=stages,
        starts=starts,
        seed=seed,
        measured=measured,
        algorithm=algorithm,
        jobs=jobs,
        report=callbacks.on_evaluation,
        checkpoint=checkpoint,
    )
    confidence, plant, held_out = None, None, None
    unbounded, interrupted = bounded, bounded.outcome == "interrupted"
    if not interrupted and has_frfs:
        try:
            settled, error = settle_floor(
                model, campaign, bounded, schedule, jobs=jobs, checkpoint=checkpoint
            )
            bounded = unbounded = fit_all_lines(
                model,
                campaign,
                settled,
                error,
                schedule,
                jobs=jobs,
                report=report_last,
                checkpoint=checkpoint,
            )
        except KeyboardInterrupt:
            bounded = replace(bounded, outcome="interrupted", advice=INTERRUPTED_ADVICE)
        interrupted = bounded.outcome == "interrupted"
    if not interrupted and has_frfs:
        try:
            unbounded = refit_without_bounds(model, campaign, bounded, jobs, checkpoint)
            chosen, has_error = choose_fit(bounded, unbounded), not error.is_at_force_error
            confidence = estimate_confidence(
                model, campaign, chosen, jobs, has_model_error=has_error
            )
            plant = estimate_plant_confidence(model, campaign, chosen, confidence, jobs)
            held_out = hold_out_lines(
                model,
                campaign,
                settled,
                schedule,
                jobs=jobs,
                report=callbacks.on_fold,
                checkpoint=checkpoint,
            )
        except KeyboardInterrupt:
            interrupted = True
    gains: tuple[GainRow, ...] = ()
    try:
        sensors, bodies = _compare_at_both(
            model, campaign, (bounded, unbounded), confidence, held_out
        )
        if inform and confidence is not None:
            gains = rank_further_tests(session, confidence)
    except KeyboardInterrupt:
        interrupted = True
        sensors, bodies = _compare_at_both(model, campaign, (bounded, unbounded), None, held_out)
    return CampaignTuning(
        session=session,
        fit=bounded,
        unbounded_fit=unbounded,
        confidence=confidence,
        plant=plant,
        held_out=held_out,
        interrupted=interrupted,
        sensors=sensors,
        bodies=bodies,
        residuals=residuals,
        measured_modes=measured,
        algorithm=algorithm,
        at=at,
        gains=gains,
    )


def refit_without_bounds(
    model: Model,
    campaign: Campaign,
    bounded: Fit,
    jobs: int = 1,
    checkpoint: Checkpoint | None = None,
) -> Fit:
    """Return the fit with the bounds of tolerances lifted, or the bounded fit if it is at none.

    Raises:
        KeyboardInterrupt: interrupted.
    """
    parametrisation = bounded.parametrisation
    if not (parametrisation.is_tolerance & parametrisation.coordinates_at_bound(bounded.x)).any():
        return bounded
    unbounded = fit(
        model,
        campaign,
        parametrisation=parametrisation.lift_bounds(),
        starts=(bounded.theta,),
        stages=(bounded.last_stage or LAST_STAGE,),
        jobs=jobs,
        checkpoint=checkpoint,
        name="without bounds",
    )
    if unbounded.outcome == "interrupted":
        raise KeyboardInterrupt
    return unbounded


def _compare_at_both(
    model: Model,
    campaign: Campaign,
    fits: tuple[Fit, Fit],
    confidence: ParameterConfidence | None,
    held_out: HeldOutFits | None,
) -> tuple[Comparison, Comparison]:
    """Return the comparisons at the sensors and at the centres of mass."""
    sensors = _compare(model, fits, confidence, held_out, campaign)
    reduced = reduce_campaign_to_bodies(campaign)
    bodies = Comparison(
        reduced,
        as_drawn=reduce_answers_to_bodies(sensors.as_drawn, campaign),
        tuned=reduce_answers_to_bodies(sensors.tuned, campaign),
        bounded=reduce_answers_to_bodies(sensors.bounded, campaign),
        deviation=None if confidence is None else magnitude_deviations(model, confidence, reduced),
        held_out=None
        if sensors.held_out is None
        else reduce_answers_to_bodies(sensors.held_out, campaign),
    )
    return sensors, bodies


def _compare(
    model: Model,
    fits: tuple[Fit, Fit],
    confidence: ParameterConfidence | None,
    held_out: HeldOutFits | None,
    campaign: Campaign,
) -> Comparison:
    """Return the comparison at the sensors."""
    bounded = predict(model, fits[0].theta, campaign)
    model_fit = choose_fit(*fits)
    return Comparison(
        campaign,
        as_drawn=predict(model, model.drawn, campaign),
        tuned=bounded if model_fit is fits[0] else predict(model, model_fit.theta, campaign),
        bounded=bounded,
        deviation=None if confidence is None else magnitude_deviations(model, confidence, campaign),
        held_out=held_out.predict(model, campaign) if held_out else None,
    )
