"""Null model: no cause added; stiffness, damping and tolerances fitted at the model-error floor."""

from dataclasses import dataclass, replace

from diagnosis.data_checks.candidates import build_gross_hypotheses
from diagnosis.data_checks.check_data import CheckedData
from diagnosis.data_checks.sensors import SensorChecks
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.refit_record import RefitRecord
from diagnosis.refits.measured import count_measured_frfs
from diagnosis.refits.outlying_tolerances import admit_outliers
from diagnosis.refits.refit import Refit
from diagnosis.refits.refitting import RefitTask, find_start, run_refits
from diagnosis.settings import DiagnosisSettings
from identification import lines_are_independent
from mbmodel import RigidDirection
from tuning import STAGES, Session, fit, random_starts

_START_FLOOR = STAGES[2].model_error_floor  # of the nominal model


@dataclass(frozen=True, eq=False)
class Baseline:
    """The null model, and what redundant channels prove.

    Args:
        scene: campaign without the channels of gross faults, model, theta of the null model.
        null: null model.
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

    Args:
        data: result of the data checks.
        jobs: processes.
        settings: schedules.
        record: finished refits; None to keep none.
    """
    scene = set_scene(data.session, data.checks, data.directions, jobs, settings)
    scene = replace(scene, record=record)
    (null,) = admit_outliers(scene, [fit_null_model(scene, settings)], settings)
    proven = build_gross_hypotheses(data.checks, data.session)
    scene = replace(scene, session=null.session, theta=null.fit.theta)
    return Baseline(scene, null, data.checks, proven)


def set_scene(
    session: Session,
    checks: SensorChecks,
    directions: tuple[RigidDirection, ...],
    jobs: int,
    settings: DiagnosisSettings,
) -> Scene:
    """Return the scene of all fits: channels without gross faults, and the thinning of the lines.

    Args:
        session: campaign and nominal model.
        checks: result of the data checks.
        directions: rigid directions of the model.
        jobs: processes.
        settings: sizes of the search.
    """
    campaign = checks.campaign
    values = count_measured_frfs(campaign) * len(campaign.freq_hz)
    return Scene(
        replace(session, campaign=campaign),
        session.model.drawn,
        directions,
        stride_factor=max(1, round(values / settings.enough_values)),
        jobs=jobs,
        settings=settings,
        has_independent_lines=lines_are_independent(session.campaign),
    )


def fit_null_model(scene: Scene, settings: DiagnosisSettings) -> Refit:
    """Fit the null model from the nominal model and, if there are few FRFs, from further starts.

    Few FRFs may be fitted by several machines.

    Args:
        scene: campaign and nominal model.
        settings: schedule and number of starts.
    """
    session = scene.session
    tasks = [RefitTask(None, session, None, _START_FLOOR)]
    count = round(settings.few_frfs / max(1, count_measured_frfs(session.campaign)))
    if count > 1:
        best = fit(
            session.model,
            session.campaign,
            parametrisation=session.parametrisation,
            starts=random_starts(session.model, count, 0, parametrisation=session.parametrisation),
            stages=STAGES[:3],
            jobs=scene.jobs,
        )
        if best.outcome == "interrupted":
            raise KeyboardInterrupt
        tasks.append(RefitTask(None, session, best.theta, _START_FLOOR))
    refits = run_refits(scene, tasks, settings.schedule)
    return min(refits, key=lambda refit: refit.objective)


def refit_from(
    scene: Scene, null: Refit, refit_with_causes: Refit, settings: DiagnosisSettings
) -> Refit:
    """Refit the null model from the end of another refit, and return the better fit.

    A fit with a cause may pass a barrier that springs and dampers alone do not cross.

    Args:
        scene: campaign and nominal model.
        null: null model.
        refit_with_causes: refit with causes.
        settings: schedule.
    """
    start = find_start(refit_with_causes, null.session, None)
    (refit,) = run_refits(
        scene, [RefitTask(None, null.session, start, null.floor)], settings.schedule
    )
    return min(null, refit, key=lambda candidate: candidate.objective)
