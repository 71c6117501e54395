"""Null model: no cause added; stiffness, damping and tolerances fitted at the model-error floor."""

from dataclasses import dataclass, replace

from diagnosis.data_checks.candidates import build_gross_hypotheses
from diagnosis.data_checks.check_data import CheckedData
from diagnosis.data_checks.sensors import SensorChecks
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.refit_record import RefitRecord, restore_fit
from diagnosis.refits.refit import Refit, describe_fit
from diagnosis.refits.refitting import (
    RefitTask,
    complete_refit,
    find_lags,
    find_start,
    run_refits,
)
from diagnosis.settings import DiagnosisSettings
from identification import lines_are_independent
from mbmodel import RigidDirection
from tuning import Session
from tuning.fitting.machine_fit import admit_shifts, count_starts, fit_first_stages, settle_floor


@dataclass(frozen=True, eq=False)
class Baseline:
    """The null model, and what redundant channels prove.

    Args:
        scene: campaign without the channels of gross faults, model, theta of the null model.
        checks: proven faults.
        proven: hypotheses of gross faults, which every set of causes contains.
    """

    scene: Scene
    null: Refit
    checks: SensorChecks
    proven: tuple[Hypothesis, ...]


def fit_baseline(
    data: CheckedData, jobs: int, settings: DiagnosisSettings, record: RefitRecord | None = None
) -> Baseline:
    """Fit the null model to the channels without gross faults.

    A fault that reciprocity proves is that of a channel or of the hits there: the better fit
    decides.

    Args:
        data: result of the data checks.
        record: finished refits; None to keep none.
    """

    def fit(checks: SensorChecks) -> Baseline:
        scene = set_scene(data.session, checks, data.directions, jobs, settings)
        null = fit_null_model(replace(scene, record=record), settings)
        proven = build_gross_hypotheses(checks, data.session)
        scene = replace(scene, record=record, session=null.session, theta=null.fit.theta)
        return Baseline(scene, null, checks, proven)

    best = fit(data.checks)
    for fault in data.checks.reciprocal:
        if of_hits := best.checks.blame_hits(fault):
            best = min(best, fit(of_hits), key=lambda baseline: baseline.null.objective)
    return best


def set_scene(
    session: Session,
    checks: SensorChecks,
    directions: tuple[RigidDirection, ...],
    jobs: int,
    settings: DiagnosisSettings,
) -> Scene:
    """Return the scene of all fits: channels without gross faults, and the thinning of the lines.

    Args:
        directions: rigid directions of the model.
    """
    campaign = checks.campaign
    return Scene(
        replace(session, campaign=campaign),
        session.parametrisation.fixed,
        directions,
        stride_factor=settings.schedule.find_stride_factor(campaign),
        jobs=jobs,
        settings=settings,
        has_independent_lines=lines_are_independent(session.campaign),
    )


def fit_null_model(scene: Scene, settings: DiagnosisSettings) -> Refit:
    """Fit the null model as a tuning does (``tuning.fitting.machine_fit``)."""
    session = scene.session
    model, campaign = session.model, session.campaign
    schedule = settings.schedule.thin(len(campaign.freq_hz), scene.stride_factor)
    record = scene.record or RefitRecord()
    name = record.next_name("no cause")
    kept = record.checkpoint.recall(name)
    if kept is None:
        first = fit_first_stages(
            model,
            campaign,
            session.parametrisation,
            schedule,
            # Without a size of default width all random starts are the nominal model.
            starts=1 if session.parametrisation.is_tolerance.all() else count_starts(campaign),
            jobs=scene.jobs,
        )
        if first.outcome == "interrupted":
            raise KeyboardInterrupt
        null, _ = settle_floor(model, campaign, first, schedule, jobs=scene.jobs)
        record.keep(name, null)
    else:
        varies = admit_shifts(session.parametrisation, kept.x[:-1])
        null = restore_fit(kept, varies, schedule)
    session = replace(session, parametrisation=null.parametrisation)
    return complete_refit(
        describe_fit(session, null, schedule.stride, find_lags(scene)), (), session
    )


def refit_from(
    scene: Scene, null: Refit, refit_with_causes: Refit, settings: DiagnosisSettings
) -> Refit:
    """Refit the null model from the end of another refit, and return the better fit.

    A fit with a cause may pass a barrier that springs and dampers alone do not cross.

    Args:
        refit_with_causes: refit with causes.
    """
    start = find_start(refit_with_causes, null.session)
    (refit,) = run_refits(
        scene, [RefitTask((), null.session, start, null.floor)], settings.schedule
    )
    return min(null, refit, key=lambda candidate: candidate.objective)
