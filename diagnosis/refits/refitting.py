"""Refits: everything that varies fitted anew with one hypothesis added, from one common start."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2, norm

from diagnosis.hypothesis import Hypothesis, Scene, Value, freed
from diagnosis.inference.evidence import BADLY_KNOWN, Gapped, Key
from diagnosis.refits.parallel import side_by_side
from identification.words import Campaign, Real, VarianceSource
from mbmodel import Model
from tuning import (
    STAGES,
    Fit,
    HeldOutFits,
    Parametrisation,
    Session,
    Stage,
    fit,
    fit_held_out,
    rebuild_for_machine,
    thin_lines,
    thinning_slice,
)

# Allowances fall from where hypotheses were scored to the noise alone, lines grow more. A wrong
# hypothesis wanders for many steps; a right one needs few. What is true of most campaigns, that
# nothing is missing, gets more.
FIRST = (replace(STAGES[3], stride=8, max_steps=5),)
# Held-out fits, whose parameters are stated: to one line in four, or to all.
SOME = replace(STAGES[4], tolerance=1e-3, max_steps=6)
ALL = replace(STAGES[5], tolerance=1e-5, max_steps=6)
_PROMISE = 0.1  # nats: of a fit whose parameters are stated
# Of 100000 values 0.03 nats: a quarter of a standard deviation.
FINAL = replace(STAGES[5], tolerance=3e-7, max_steps=60, exact_curvature=True)
CLOSE = (*FIRST, replace(STAGES[4], stride=8, tolerance=1e-3, max_steps=6))
LAST = (replace(STAGES[4], tolerance=3e-4, max_steps=10),)
# The way to the weights of the noise leads by the logarithm and its large allowance: a fit without
# the effect has bent all else, and straight from there many a fit with it ends before its minimum,
# a bypass at 1.016 instead of 1.006 of the noise, a delay at twice its length.
LEVELLED = replace(STAGES[2], stride=8, max_steps=15)
ONWARD = (LEVELLED, *FIRST, *LAST)
# From the drawing all is off: there springs and dampers go first.
FROM_AFAR = (replace(STAGES[1], stride=8), LEVELLED, *CLOSE)
SOON = (replace(STAGES[4], max_steps=4),)
# Who leads and has not arrived may creep along a valley: of a strong link sixty steps by the normal
# equations alone went 6 % of the way to the minimum, as many by its own curvature 76 %.
LONG = (replace(STAGES[4], tolerance=1e-5, max_steps=20, exact_curvature=True),)
# A shape that begins as a guess, nothing pushing it, needs the logarithm and its large allowance.
SHAPED = (
    replace(STAGES[2], stride=8, max_steps=20),
    replace(STAGES[3], stride=8, max_steps=20),
    *LAST,
)
# Lines apart: a variance from third differences has a part in three, a mode spans several.
_LAGS = range(3, 7)
_ENOUGH = 180_000  # values: three hammer directions, 69 channels, 800 lines and some more
_FAR = 8.0  # standard deviations, of a tolerance that is no outlier
PATIENT = (STAGES[3], replace(STAGES[4], tolerance=3e-4, max_steps=30))


@dataclass(frozen=True, eq=False)
class Refit(Gapped):
    """A hypothesis, fitted.

    Args:
        hypothesis: None if nothing is missing.
        session: campaign as it would be without the fault, model with what is added.
        fit: at the weights of the last stage, one line in four.
        chi_square: mean square of residual over noise and allowance there; noise alone leaves one.
        serial: the mean product of residuals of neighbouring lines, all lines; None where noise is
            shared or the fit has an allowance.
        doubt: what chi square may exceed one by where nothing is left.
        loose: one more than the gap if tolerances have no bounds; None where that was not asked.
        pull: the largest of them then, in standard deviations.
    """

    hypothesis: Hypothesis | None
    session: Session
    fit: Fit
    chi_square: float
    serial: float | None = None
    doubt: float = BADLY_KNOWN["differences"]
    loose: float | None = None
    pull: float | None = None

    def nats(self) -> float:
        """Cost, priors and all."""
        return self.fit.cost

    @property
    def cost(self) -> float:
        """In nats, priors and all."""
        return self.nats()

    @property
    def key(self) -> Key | None:
        """Effect, place and direction of its hypothesis; None without one."""
        return None if self.hypothesis is None else self.hypothesis.key

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Of its hypothesis; none without one."""
        return () if self.hypothesis is None else self.hypothesis.coordinates

    def parameters(self) -> dict[str, Value]:
        """What the verdict states of it, as fitted."""
        return {} if self.hypothesis is None else self.stated(self.hypothesis, self.fit.theta)

    def stated(self, one: Hypothesis, theta: Real) -> dict[str, Value]:
        """What the verdict states of a hypothesis at a theta."""
        return one.state(named(self.fit.parametrisation, theta))

    def along(self, one: Hypothesis) -> str | None:
        """The direction that the fit gives a hypothesis."""
        return one.along(named(self.fit.parametrisation, self.fit.theta))


def measured(campaign: Campaign) -> int:
    """How many FRFs there are."""
    return sum(int(test.estimate.measured.sum()) for test in campaign.tests)


def plenty(campaign: Campaign) -> float:
    """How many times as much was measured as fits need."""
    return measured(campaign) * len(campaign.freq_hz) / _ENOUGH


def paced(stages: tuple[Stage, ...], pace: int) -> tuple[Stage, ...]:
    """Stages that count every so manyth of their lines."""
    return tuple(replace(stage, stride=stage.stride * pace) for stage in stages)


def named(varies: Parametrisation, theta: Real) -> dict[str, float]:
    """Parameters in SI by name."""
    names = (parameter.name for parameter in varies.parameters)
    return dict(zip(names, theta.tolist(), strict=True))


def posed(scene: Scene, one: Hypothesis | None, campaign: Campaign) -> Session:
    """The session under a hypothesis.

    Args:
        scene: without it.
        one: the hypothesis.
        campaign: all that was measured, uncorrected.
    """
    session = replace(scene.session, campaign=campaign)
    if one is None:
        return session
    model = session.model
    if one.reform is not None:
        model = rebuild_for_machine(model, one.reform(model.machine))
    model = Model(model.machine, (*model.parts, *one.parts))
    corrected = campaign if one.correct is None else one.correct(campaign)
    return replace(
        session,
        model=model,
        campaign=corrected,
        parametrisation=freed(session.parametrisation, model, session, one),
    )


def refit(
    scene: Scene, one: Hypothesis | None, campaign: Campaign, stages: tuple[Stage, ...]
) -> Refit:
    """Fit under a hypothesis, from the scene's theta.

    Args:
        scene: whose theta is the start.
        one: the hypothesis; None for nothing missing.
        campaign: all that was measured.
        stages: to go through.
    """
    return _only(fitted(scene, [asked(scene, one, campaign, stages)]))


def go_on(scene: Scene, found: Refit, stages: tuple[Stage, ...]) -> Refit:
    """The same, further stages."""
    return _only(fitted(scene, [further(found, stages)]))


@dataclass(frozen=True, eq=False)
class RefitTask:
    """A refit to be made.

    Args:
        hypothesis: None if nothing is missing.
        session: under it.
        start: theta; (n_parameter,).
        stages: to go through.
    """

    hypothesis: Hypothesis | None
    session: Session
    start: Real
    stages: tuple[Stage, ...]


def asked(
    scene: Scene, one: Hypothesis | None, campaign: Campaign, stages: tuple[Stage, ...]
) -> RefitTask:
    """What ``refit`` does, to be made beside others."""
    session = posed(scene, one, campaign)
    return RefitTask(one, session, _start(scene, session, one), stages)


def further(found: Refit, stages: tuple[Stage, ...]) -> RefitTask:
    """A refit's further stages, to be made beside others."""
    return RefitTask(found.hypothesis, found.session, found.fit.theta, stages)


def begun_at(task: RefitTask, other: Refit) -> RefitTask:
    """The same, begun where another refit ended, in the parameters that both have."""
    there = named(other.fit.parametrisation, other.fit.theta)
    here = named(task.session.parametrisation, task.start)
    start = np.array([there.get(name, value) for name, value in here.items()])
    return replace(task, start=start)


def fitted(scene: Scene, tasks: Sequence[RefitTask]) -> Iterator[Refit]:
    """Refits that do not wait for each other, in processes; each as soon as those before are there.

    Sessions are sent: hypotheses, which are known by what they are, stay here.
    """
    threads = scene.jobs if len(tasks) == 1 else 1
    sent = [
        (_fit, (one.session, one.start, paced(one.stages, scene.pace), threads, scene.independent))
        for one in tasks
    ]
    made = side_by_side(sent, scene.jobs)
    for task, (found, chi_square, serial) in zip(tasks, made, strict=True):
        own = replace(uninterrupted(found), parametrisation=task.session.parametrisation)
        doubt = BADLY_KNOWN[source_of(task.session.campaign)]
        yield Refit(task.hypothesis, task.session, own, chi_square, serial, doubt)


def unbounded(scene: Scene, made: Refit) -> Refit:
    """The same, with what it leaves if tolerances have no bounds, and the largest of them then.

    Of 300 tolerances the largest is beyond three standard deviations in every second machine, and
    what its bound then leaves is no effect. Where they go far beyond at once nobody asks how far.
    """
    found = free(scene, made)
    return replace(made, loose=1 + found.gap, pull=pull_of(found))


def free(scene: Scene, made: Refit) -> Refit:
    """The same, tolerances without bounds."""
    session = replace(made.session, parametrisation=made.session.parametrisation.lift_bounds())
    found = replace(made, session=session)
    for stages in (SOON, LONG):
        found = go_on(scene, found, stages)
        if pull_of(found) > _FAR:
            break
    return found


def pull_of(found: Refit) -> float:
    """The largest of all tolerances, in standard deviations."""
    return float(np.abs(found.fit.x[found.fit.parametrisation.has_prior]).max(initial=0.0))


def off_by(found: Refit, one: Hypothesis) -> float | None:
    """How far the tolerances are off that a hypothesis does nothing but release.

    As unlikely as one alone that is off by z standard deviations: their sum of squares is chi
    square with as many degrees of freedom as there are, where nothing is wrong, and
    z = -Phi^-1(p / 2) of its upper tail p.

    Args:
        found: a refit with it, alone or beside another.
        one: the hypothesis.

    Returns:
        z; None of what does something else.
    """
    if one.parts or one.correct is not None or one.reform is not None or not one.release:
        return None
    x = found.fit.x[np.isin(np.array(found.fit.parametrisation.names), one.release)]
    tail = max(float(chi2.sf(x @ x, x.size)), np.finfo(float).tiny)
    return float(norm.isf(tail / 2))


def _only(made: Iterator[Refit]) -> Refit:
    (one,) = made
    return one


def _fit(
    session: Session, start: Real, stages: tuple[Stage, ...], threads: int, independent: bool
) -> tuple[Fit, float, float | None]:
    """A fit, its chi square, and what neighbouring lines share of what it leaves."""
    varies, last = session.parametrisation, stages[-1]
    found = fit(
        session.model,
        session.campaign,
        parametrisation=varies,
        starts=(start,),
        stages=stages,
        jobs=threads,
    )
    problem = last.build_misfit(session.model, thin_lines(session.campaign, last.stride), varies)
    data = found.cost - problem.prior(found.x)
    serial = None
    if independent and not last.model_error_floor:
        whole = last.build_misfit(session.model, session.campaign, varies)
        lines = len(session.campaign.freq_hz)
        seen = np.isin(np.arange(lines), np.arange(lines)[thinning_slice(lines, last.stride)])
        serial = whole.serial_covariance(found.x, _LAGS, seen)
    return found, data / max(problem.values, 1), serial


def _start(scene: Scene, session: Session, one: Hypothesis | None) -> Real:
    more = len(session.model.parameters) - len(scene.theta)
    theta = np.append(scene.theta, np.zeros(more))
    if one is not None:
        names = [parameter.name for parameter in session.model.parameters]
        for name, value in one.begin.items():
            theta[names.index(name)] = value
        for name, other in one.follow.items():
            theta[names.index(name)] = theta[names.index(other)]
    return theta


def held_out(
    found: Refit, stage: Stage, jobs: int = 1, width: int | None = None
) -> HeldOutFits | None:
    """The same to all lines of a stage but each fold of them.

    Args:
        found: the refit.
        stage: which lines count.
        jobs: threads.
        width: lines in a block; by the modes of this model if None.
    """
    session, begun = found.session, replace(found.fit, last_stage=stage)
    return fit_held_out(
        session.model, begun, session.campaign, jobs=jobs, width=width, min_gain_nats=_PROMISE
    )


def source_of(campaign: Campaign) -> VarianceSource:
    """Where the noise's variance comes from; the worse source if there are two."""
    sources = {test.estimate.variance_source for test in campaign.tests}
    return "coherence" if sources == {"coherence"} else "differences"


def uninterrupted(found: Fit) -> Fit:
    """The fit, if nobody broke it off: half a fit would be a verdict on nothing.

    Raises:
        KeyboardInterrupt: it was.
    """
    if found.outcome == "interrupted":
        raise KeyboardInterrupt
    return found
