"""Refits: everything that varies is fitted again with a set of causes, at that set's error floor.

A fit at the weights of the noise goes down to errors that no real model has. Each refit therefore
tolerates the model error that its own residual shows (``tuning.fit_at_error_floor``). A cause is
worth what the floor falls by.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.hypothesis_set import join_hypotheses
from diagnosis.inference.evidence import BADLY_KNOWN
from diagnosis.refit_record import RefitRecord, restore_fit
from diagnosis.refits.extended_parametrisation import extend_parametrisation
from diagnosis.refits.measured import choose_stride, find_variance_source
from diagnosis.refits.parallel import Call, run_in_parallel
from diagnosis.refits.refit import Refit, describe_fit
from identification.words import Real
from mbmodel import Model
from tuning import (
    STAGES,
    Checkpoint,
    FloorSchedule,
    Minimum,
    Session,
    Stage,
    fit_at_error_floor,
    rebuild_for_machine,
)

# A shape that begins as a guess needs the logarithm of the FRFs and its large floor first.
FROM_AFAR = (replace(STAGES[1], stride=8), replace(STAGES[2], stride=8, max_steps=15))


@dataclass(frozen=True, eq=False)
class RefitTask:
    """A refit to be made.

    Args:
        hypothesis: the set of causes; None for the null model.
        session: session with them.
        start: theta [SI]; (n_parameter,); None for the nominal model.
        floor: relative model error that the first fit tolerates.
        first_stages: stages before that.
    """

    hypothesis: Hypothesis | None
    session: Session
    start: Real | None
    floor: float
    first_stages: tuple[Stage, ...] = ()


def add_hypothesis(session: Session, hypothesis: Hypothesis) -> Session:
    """Return a session with the Parts, corrections and released tolerances of a hypothesis."""
    model = session.model
    if hypothesis.reform is not None:
        model = rebuild_for_machine(model, hypothesis.reform(model.machine))
    model = Model(model.machine, (*model.parts, *hypothesis.parts))
    correct = hypothesis.correct
    return replace(
        session,
        model=model,
        campaign=session.campaign if correct is None else correct(session.campaign),
        parametrisation=extend_parametrisation(session.parametrisation, model, session, hypothesis),
    )


def start_values(base: Refit | Scene, session: Session, hypothesis: Hypothesis | None) -> Real:
    """Return theta of a session that begins where a fit ended; (n_parameter,).

    Args:
        base: fit, or scene with its theta.
        session: session with the hypothesis.
        hypothesis: new parameters begin at its values.
    """
    theta = base.theta if isinstance(base, Scene) else base.fit.theta
    parameters = base.session.model.parameters
    fitted = dict(zip((p.name for p in parameters), theta.tolist(), strict=True))
    names = [parameter.name for parameter in session.model.parameters]
    begin = {} if hypothesis is None else {**fitted, **hypothesis.begin}
    follow = {} if hypothesis is None else hypothesis.follow
    values = [begin.get(name, fitted.get(name, 0.0)) for name in names]
    for k, name in enumerate(names):
        if name in follow:
            values[k] = values[names.index(follow[name])]
    return np.array(values)


def add_cause(
    base: Refit, hypothesis: Hypothesis, first_stages: tuple[Stage, ...] = ()
) -> RefitTask:
    """Return the task of a refit with one more cause, from where a refit ended."""
    session = add_hypothesis(base.session, hypothesis)
    start = start_values(base, session, hypothesis)
    causes = join_hypotheses((*base.causes, hypothesis))
    return RefitTask(causes, session, start, base.floor, first_stages)


def run_refits(scene: Scene, tasks: Sequence[RefitTask], schedule: FloorSchedule) -> list[Refit]:
    """Make refits that do not wait for each other, in processes; the order is that of the tasks.

    Sessions are sent to the processes; hypotheses, which are known by identity, stay here.

    Args:
        scene: processes, thinning of the lines, and whether lines are independent.
        tasks: refits to be made.
        schedule: fits in turn with their floor.
    """
    threads = scene.jobs if len(tasks) == 1 else 1
    lines = len(scene.session.campaign.freq_hz)
    paced = replace(schedule, stride=choose_stride(lines, schedule.stride * scene.stride_factor))
    record = scene.record or RefitRecord(Checkpoint())
    names = [record.next_name(_words(task)) for task in tasks]
    finished = [record.recall(name) for name in names]
    calls: list[Call] = [
        (_refit, (replace(task, hypothesis=None), paced, threads, scene.has_independent_lines))
        if kept is None
        else (_describe_kept, (task.session, kept, paced, scene.has_independent_lines))
        for task, kept in zip(tasks, finished, strict=True)
    ]
    results = []
    ended = islice(run_in_parallel(calls, scene.jobs), len(tasks))
    for name, kept, refit in zip(names, finished, ended, strict=True):
        if kept is None:
            record.keep(name, refit.fit)
        results.append(refit)
    return [
        replace(
            refit,
            hypothesis=task.hypothesis,
            session=task.session,
            fit=replace(refit.fit, parametrisation=task.session.parametrisation),
            doubt=BADLY_KNOWN[find_variance_source(task.session.campaign)],
        )
        for task, refit in zip(tasks, results, strict=True)
    ]


def _words(task: RefitTask) -> str:
    """Return the causes of a refit in words."""
    if task.hypothesis is None:
        return "no cause"
    causes = task.hypothesis.members or (task.hypothesis,)
    return " + ".join(cause.words for cause in causes)


def _describe_kept(
    session: Session, kept: Minimum, schedule: FloorSchedule, independent: bool
) -> Refit:
    """Return a refit that an interrupted run finished."""
    fit = restore_fit(kept, session.parametrisation, schedule)
    return describe_fit(session, fit, schedule.stride, independent)


def _refit(task: RefitTask, schedule: FloorSchedule, threads: int, independent: bool) -> Refit:
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
    return describe_fit(session, result.fit, schedule.stride, independent)
