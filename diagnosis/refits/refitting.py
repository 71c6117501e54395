"""Refits: everything that varies is fitted with a set of causes, at the error floor of that set.

With the weights of the noise alone, a fit minimises errors that every real model has. Each refit
therefore tolerates the model error that its residual shows (``tuning.fit_at_error_floor``). The
value of a cause is the decrease of that floor.

Refits with wider bounds on tolerances that lie beyond their bounds by chance.

See ``tuning.fitting.machine_fit``, by which the null model admits them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.inference.calibration import find_variance_source, load_calibration
from diagnosis.refit_record import RefitRecord, restore_fit
from diagnosis.refits.extended_parametrisation import extend_parametrisation, merge_values
from diagnosis.refits.refit import Refit, describe_fit
from diagnosis.settings import DiagnosisSettings
from identification.words import Real
from mbmodel import Model
from tuning import (
    FloorSchedule,
    Minimum,
    Session,
    Stage,
    estimate_model_error,
    fit_at_error_floor,
    predict,
    rebuild_for_machine,
    thin_lines,
)
from tuning.fitting.machine_fit import are_by_chance, widen_outliers
from tuning.misfit.residual_statistics import ModelError
from tuning.workers.independent_calls import Call, run_in_parallel


@dataclass(frozen=True, eq=False)
class RefitTask:
    """Refit to be made.

    Args:
        causes: set of causes; none for the null model.
        session: session with the causes.
        start: start values [SI]; (n_parameter,); None for the nominal model.
        floor: relative model error that the first fit tolerates.
        first_stages: stages before the first fit.
    """

    causes: tuple[Hypothesis, ...]
    session: Session
    start: Real | None
    floor: float
    first_stages: tuple[Stage, ...] = ()


def add_hypotheses(session: Session, *hypotheses: Hypothesis) -> Session:
    """Return a session with the Parts, corrections and released tolerances of hypotheses.

    Only the first reform of the machine is used: that of a body that bends adds the modes of all
    bodies that bend.
    """
    model, campaign = session.model, session.campaign
    reform = next((each.reform for each in hypotheses if each.reform is not None), None)
    if reform is not None:
        model = rebuild_for_machine(model, reform(model.machine))
    model = Model(model.machine, (*model.parts, *(p for each in hypotheses for p in each.parts)))
    for hypothesis in hypotheses:
        campaign = campaign if hypothesis.correct is None else hypothesis.correct(campaign)
    varies = extend_parametrisation(session.parametrisation, model, session, hypotheses)
    return replace(session, model=model, campaign=campaign, parametrisation=varies)


def find_start(base: Refit | Scene, session: Session, *hypotheses: Hypothesis) -> Real:
    """Return the start of a session from the end of a fit; (n_parameter,).

    Args:
        base: fit, or scene with its theta.
        session: session with the hypotheses.
        hypotheses: hypotheses with start values of new parameters.
    """
    theta = base.theta if isinstance(base, Scene) else base.fit.theta
    parameters = base.session.model.parameters
    fitted = dict(zip((p.name for p in parameters), theta.tolist(), strict=True))
    names = [parameter.name for parameter in session.model.parameters]
    starts = merge_values((fitted, *(each.begin for each in hypotheses)))
    follow = merge_values(each.follow for each in hypotheses)
    values = [starts.get(name, 0.0) for name in names]
    for k, name in enumerate(names):
        if name in follow:
            values[k] = values[names.index(follow[name])]
    return np.array(values)


def add_cause(
    base: Refit, hypothesis: Hypothesis, first_stages: tuple[Stage, ...] = ()
) -> RefitTask:
    """Return the task of a refit with one more cause, from the end of a refit."""
    session = add_hypotheses(base.session, hypothesis)
    start = find_start(base, session, hypothesis)
    return RefitTask((*base.causes, hypothesis), session, start, base.floor, first_stages)


def limit_floor(task: RefitTask, stride: int) -> RefitTask:
    """Return a refit that starts at the model error of its start values, at most its floor.

    Args:
        task: refit with start values.
        stride: every ``stride``-th line counts.
    """
    error = estimate_start_error(task, stride)
    return task if error is None else replace(task, floor=min(error.floor, task.floor))


def estimate_start_error(task: RefitTask, stride: int) -> ModelError | None:
    """Return the model error of a refit's start values; None without them or what they predict."""
    if task.start is None:
        return None
    thin = thin_lines(task.session.campaign, stride)
    return estimate_model_error(predict(task.session.model, task.start, thin), thin)


def run_refits(scene: Scene, tasks: Sequence[RefitTask], schedule: FloorSchedule) -> list[Refit]:
    """Make independent refits in processes; the order of the results is that of the tasks.

    Sessions are sent to the processes. Hypotheses are compared by identity, so that they stay here.

    Args:
        scene: processes, thinning of the lines, independence of lines, settings.
        tasks: refits to be made.
        schedule: fits that alternate with estimates of the floor.
    """
    threads = scene.jobs if len(tasks) == 1 else 1
    schedule = schedule.thin(len(scene.session.campaign.freq_hz), scene.stride_factor)
    lags = find_lags(scene)
    record = scene.record or RefitRecord()
    names = [record.next_name(_name_causes(task)) for task in tasks]
    finished = [record.checkpoint.recall(name) for name in names]
    calls: list[Call] = [
        (_refit, (replace(task, causes=()), schedule, threads, lags))
        if kept is None
        else (_describe_kept, (task.session, kept, schedule, lags))
        for task, kept in zip(tasks, finished, strict=True)
    ]
    results = []
    ended = islice(run_in_parallel(calls, scene.jobs), len(tasks))
    for name, kept, refit in zip(names, finished, ended, strict=True):
        if kept is None:
            record.keep(name, refit.fit)
        results.append(refit)
    return [
        complete_refit(refit, task.causes, task.session)
        for task, refit in zip(tasks, results, strict=True)
    ]


def find_lags(scene: Scene) -> tuple[int, ...]:
    """Return the distances of neighbouring lines that show a gap; none if lines share noise."""
    return scene.settings.serial_lags if scene.has_independent_lines else ()


def complete_refit(refit: Refit, causes: tuple[Hypothesis, ...], session: Session) -> Refit:
    """Return a refit with its causes and session, and what follows from these."""
    fit = replace(refit.fit, parametrisation=session.parametrisation)
    refit = replace(refit, causes=causes, session=session, fit=fit)
    numbers = {
        "keys": refit.keys,
        "prior": float(fit.x @ (fit.parametrisation.precision * fit.x) / 2),
        "doubt": load_calibration().hidden[find_variance_source(session.campaign)],
        "shifts": tuple(map(refit.tolerance_shift, refit.causes)),
        "parameters": tuple(map(refit.count_parameters, refit.causes)),
    }
    return replace(refit, summary=refit.summary.model_copy(update=numbers))


def _name_causes(task: RefitTask) -> str:
    """Return the causes of a refit in words."""
    return " + ".join(cause.words for cause in task.causes) or "no cause"


def _describe_kept(
    session: Session, kept: Minimum, schedule: FloorSchedule, lags: Sequence[int]
) -> Refit:
    """Return a refit that an interrupted run finished."""
    fit = restore_fit(kept, session.parametrisation, schedule)
    return describe_fit(session, fit, schedule.stride, lags)


def _refit(task: RefitTask, schedule: FloorSchedule, threads: int, lags: Sequence[int]) -> Refit:
    session = task.session
    result = fit_at_error_floor(
        session.model,
        session.campaign,
        session.parametrisation,
        start=task.start,
        first_stages=task.first_stages,
        floor=task.floor,
        schedule=schedule,
        jobs=threads,
    )
    return describe_fit(session, result.fit, schedule.stride, lags)


def admit_outliers(
    scene: Scene, refits: Sequence[Refit], settings: DiagnosisSettings
) -> list[Refit]:
    """Return refits with wider bounds on outlying tolerances, if these lower the objective.

    Args:
        refits: the null model, or sets of causes.
        settings: schedule, and the largest outlier.
    """
    sigma, tasks, chosen = settings.outlier_sigma, [], []
    for number, refit in enumerate(refits):
        wide = widen_outliers(refit.session.parametrisation, refit.fit.x, sigma)
        if wide is not None:
            session = replace(refit.session, parametrisation=wide)
            tasks.append(RefitTask(refit.causes, session, refit.fit.theta, refit.floor))
            chosen.append(number)
    admitted = list(refits)
    for number, wider in zip(chosen, run_refits(scene, tasks, settings.schedule), strict=True):
        refit = refits[number]
        coordinates = refit.session.parametrisation, wider.session.parametrisation
        if wider.objective < refit.objective and are_by_chance(*coordinates, wider.fit.x, sigma):
            admitted[number] = wider
    return admitted
