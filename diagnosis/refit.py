"""Refits: everything that varies fitted anew with one hypothesis added, from one common start."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.evidence import Key
from diagnosis.hypothesis import Ends, Hypothesis, Scene, Value, freed
from identification.words import Campaign, Real
from mbmodel import Model
from tuning import (
    PLAUSIBLE,
    QUANTILE,
    STAGES,
    Confidence,
    Fit,
    Freedom,
    HeldOut,
    Session,
    Stage,
    confidence,
    fit,
    fit_held_out,
    on_machine,
    thinned,
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
FINAL = replace(STAGES[5], tolerance=3e-7, max_steps=15)
CLOSE = (*FIRST, replace(STAGES[4], stride=8, tolerance=1e-3, max_steps=6))
LAST = (replace(STAGES[4], tolerance=3e-4, max_steps=10),)
LONG = (replace(STAGES[4], tolerance=1e-5, max_steps=20),)
# A shape that begins as a guess, nothing pushing it, needs the logarithm and its large allowance.
SHAPED = (
    replace(STAGES[2], stride=8, max_steps=20),
    replace(STAGES[3], stride=8, max_steps=20),
    *LAST,
)
PATIENT = (STAGES[3], replace(STAGES[4], tolerance=3e-4, max_steps=30))


@dataclass(frozen=True, eq=False)
class Refit:
    """A hypothesis, fitted.

    Args:
        hypothesis: None if nothing is missing.
        session: campaign as it would be without the fault, model with what is added.
        fit: at the weights of the last stage, one line in four.
        chi_square: mean square of residual over noise and allowance there; noise alone leaves one.
        loose: the same if tolerances have no bounds; None where that was not asked.
        pull: the largest of them then, in standard deviations.
    """

    hypothesis: Hypothesis | None
    session: Session
    fit: Fit
    chi_square: float
    loose: float | None = None
    pull: float | None = None

    @property
    def cost(self) -> float:
        """In nats, priors and all."""
        return self.fit.cost

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
        return one.state(_named(self.fit.freedom, theta))


@dataclass(frozen=True, eq=False)
class Known:
    """What is known of a refit's parameters.

    Args:
        freedom: its coordinates.
        theta: the parameters; (n_parameter,).
        sure: their confidence.
    """

    freedom: Freedom
    theta: Real
    sure: Confidence

    def stated(self, one: Hypothesis) -> dict[str, Value]:
        """What the verdict states of a hypothesis."""
        return one.state(_named(self.freedom, self.theta))

    def intervals(self, one: Hypothesis) -> dict[str, Ends]:
        """Of a hypothesis' parameters, 95 %; none of those that were not fitted.

        With C the covariance of the coordinates x and g the slope of a stated number y, its ends
        are y(x +- q C g / sqrt(g' C g)): of y linear in x those are y +- q sqrt(g' C g), of the
        exponential of a coordinate those of its logarithm.
        """
        varies, sure, x = self.freedom, self.sure, self.sure.x
        middle = self.stated(one)
        flat = _flat(middle)
        read = _Read(_named(varies, self.theta))
        one.state(read)
        own = [k for k, name in enumerate(varies.names) if name in read.names]
        covariance = sure.covariance[np.ix_(own, own)]

        def moved(by: Real) -> Real:
            change = np.zeros(len(x))
            change[own] = by
            stated = middle | one.state(_named(varies, varies.theta(x + change)))
            return _flat({name: stated[name] for name in middle})

        slopes = np.zeros((len(flat), len(own)))
        for place, step in enumerate(0.1 * sure.deviation[own]):
            slopes[:, place] = (moved(step * (np.arange(len(own)) == place)) - flat) / step
        ends = np.tile(flat, (3, 1))
        for place, slope in enumerate(slopes):
            spread = np.sqrt(slope @ covariance @ slope)
            if spread > 0:
                farthest = QUANTILE * (covariance @ slope) / spread
                ends[1:, place] = moved(-farthest)[place], moved(farthest)[place]
        return _paired(middle, ends.min(axis=0), ends.max(axis=0))


class _Read(dict[str, float]):
    """Parameters by name, that knows which of them were asked for."""

    def __init__(self, values: Mapping[str, float]) -> None:
        super().__init__(values)
        self.names: set[str] = set()

    def __getitem__(self, name: str) -> float:
        """A value."""
        self.names.add(name)
        return super().__getitem__(name)

    def get(self, name: str, default: float = 0.0) -> float:  # type: ignore[override]
        """A value, or the default."""
        self.names.add(name)
        return super().get(name, default)


def known(found: Refit, theta: Real, stride: int, jobs: int = 1) -> Known:
    """Parameters and their confidence, tolerances without bounds unless these hide a fault.

    Of 300 tolerances some are beyond 2.5 standard deviations: their bounds, which the gap is
    stated with, push what was found by up to five of its own.

    Args:
        found: the refit.
        theta: where to begin, within the bounds; (n_parameter,).
        stride: every so manyth line counts.
        jobs: threads.
    """
    model, campaign, varies = found.session.model, found.session.campaign, found.fit.freedom
    stage = replace(FINAL, stride=stride)
    for own in (varies.unbounded(), varies):
        best = uninterrupted(
            fit(model, campaign, varies=own, starts=(theta,), stages=(stage,), jobs=jobs)
        )
        if np.abs(best.x[own.has_prior]).max(initial=0.0) <= PLAUSIBLE:
            break
    sure = confidence(model, thinned(campaign, stride), best, jobs)
    return Known(best.freedom, best.theta, sure)


def paced(stages: tuple[Stage, ...], pace: int) -> tuple[Stage, ...]:
    """Stages that count every so manyth of their lines."""
    return tuple(replace(stage, stride=stage.stride * pace) for stage in stages)


def _named(varies: Freedom, theta: Real) -> dict[str, float]:
    """Parameters in SI by name."""
    names = (parameter.name for parameter in varies.parameters)
    return dict(zip(names, theta.tolist(), strict=True))


def _flat(stated: Mapping[str, Value]) -> Real:
    """All numbers in a row."""
    return np.concatenate([np.ravel(value) for value in stated.values()] or [np.zeros(0)])


def _paired(stated: Mapping[str, Value], low: Real, high: Real) -> dict[str, Ends]:
    """Low and high of each number, of a vector those of each component."""
    found: dict[str, Ends] = {}
    place = 0
    for name, value in stated.items():
        size = int(np.size(value))
        span = slice(place, place + size)
        pairs = tuple(zip(low[span].tolist(), high[span].tolist(), strict=True))
        if (high[span] > low[span]).any():
            found[name] = pairs if isinstance(value, tuple) else pairs[0]
        place += size
    return found


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
        model = on_machine(model, one.reform(model.machine))
    model = Model(model.machine, (*model.parts, *one.parts))
    corrected = campaign if one.correct is None else one.correct(campaign)
    return replace(
        session,
        model=model,
        campaign=corrected,
        freedom=freed(session.freedom, model, session, one),
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
    session = posed(scene, one, campaign)
    return _fitted(one, session, _start(scene, session, one), paced(stages, scene.pace))


def go_on(scene: Scene, found: Refit, stages: tuple[Stage, ...]) -> Refit:
    """The same, further stages."""
    return _fitted(found.hypothesis, found.session, found.fit.theta, paced(stages, scene.pace))


def from_where(scene: Scene, found: Refit, other: Refit, stages: tuple[Stage, ...]) -> Refit:
    """The same, further stages, from where another ended in the parameters that both have."""
    there = _named(other.fit.freedom, other.fit.theta)
    here = _named(found.fit.freedom, found.fit.theta)
    start = np.array([there.get(name, value) for name, value in here.items()])
    return _fitted(found.hypothesis, found.session, start, paced(stages, scene.pace))


def unbounded(scene: Scene, made: Refit) -> Refit:
    """The same, with what it leaves if tolerances have no bounds, and the largest of them then.

    Of 300 tolerances the largest is beyond three standard deviations in every second machine, and
    what its bound then leaves is no effect.
    """
    session = replace(made.session, freedom=made.session.freedom.unbounded())
    found = _fitted(None, session, made.fit.theta, paced(LONG, scene.pace))
    pulls = np.abs(found.fit.x[found.fit.freedom.has_prior])
    return replace(made, loose=found.chi_square, pull=float(pulls.max(initial=0.0)))


def _fitted(
    one: Hypothesis | None, session: Session, start: Real, stages: tuple[Stage, ...]
) -> Refit:
    varies, last = session.freedom, stages[-1]
    found = uninterrupted(
        fit(session.model, session.campaign, varies=varies, starts=(start,), stages=stages)
    )
    problem = last.misfit(session.model, thinned(session.campaign, last.stride), varies)
    data = found.cost - problem.prior(found.x)
    return Refit(one, session, found, data / max(problem.values, 1))


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


def held_out(found: Refit, stage: Stage, jobs: int = 1, width: int | None = None) -> HeldOut | None:
    """The same to all lines of a stage but each fold of them.

    Args:
        found: the refit.
        stage: which lines count.
        jobs: threads.
        width: lines in a block; by the modes of this model if None.
    """
    session, begun = found.session, replace(found.fit, last=stage)
    return fit_held_out(
        session.model, begun, session.campaign, jobs=jobs, width=width, promise=_PROMISE
    )


def uninterrupted(found: Fit) -> Fit:
    """The fit, if nobody broke it off: half a fit would be a verdict on nothing.

    Raises:
        KeyboardInterrupt: it was.
    """
    if found.outcome == "interrupted":
        raise KeyboardInterrupt
    return found
