"""Refits: everything that varies fitted anew with one hypothesis added, from one common start."""

from dataclasses import dataclass, replace

import numpy as np

from diagnosis.effects import EFFECTS
from diagnosis.hypothesis import Hypothesis, Scene, Value, freed
from identification.words import Campaign, Real
from mbmodel import Model
from tuning import STAGES, Fit, HeldOut, Session, Stage, fit, fit_held_out, thinned

# Allowances fall from where hypotheses were scored to the noise alone; one line in four. A wrong
# hypothesis wanders for many steps; a right one needs few. What is true of most campaigns, that
# nothing is missing, gets more.
FIRST = (replace(STAGES[3], max_steps=5),)
LAST = (replace(STAGES[4], tolerance=3e-4, max_steps=10),)
PATIENT = (STAGES[3], replace(STAGES[4], tolerance=3e-4, max_steps=30))
_WHOLE = (replace(STAGES[5], tolerance=1e-4, max_steps=2),)


@dataclass(frozen=True, eq=False)
class Refit:
    """A hypothesis, fitted.

    Args:
        hypothesis: None if nothing is missing.
        session: campaign as it would be without the fault, model with what is added.
        fit: at the weights of the last stage, one line in four.
        chi_square: mean square of residual over noise and allowance there; noise alone leaves one.
        values: how many values that counts.
    """

    hypothesis: Hypothesis | None
    session: Session
    fit: Fit
    chi_square: float
    values: int

    @property
    def cost(self) -> float:
        """In nats, priors and all."""
        return self.fit.cost

    def parameters(self, at: Fit | None = None) -> dict[str, Value]:
        """What the verdict states of it."""
        if self.hypothesis is None:
            return {}
        found = self.fit if at is None else at
        names = (parameter.name for parameter in found.freedom.parameters)
        return self.hypothesis.state(dict(zip(names, found.theta.tolist(), strict=True)))


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
    model = Model(session.model.machine, (*session.model.parts, *one.parts))
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
    return _fitted(one, session, _start(scene, session, one), stages)


def go_on(scene: Scene, found: Refit, stages: tuple[Stage, ...]) -> Refit:
    """The same, further stages; what is proportional to a stiffness takes the fitted one."""
    one, session = found.hypothesis, found.session
    if one is not None and one.parts:
        fitted = replace(scene, theta=found.fit.theta[: len(scene.theta)])
        proposed = EFFECTS[one.effect](fitted)
        one = next(other for other in proposed if other.coordinates == one.coordinates)
        session = posed(scene, one, scene.session.campaign)
    return _fitted(one, session, found.fit.theta, stages)


def _fitted(
    one: Hypothesis | None, session: Session, start: Real, stages: tuple[Stage, ...]
) -> Refit:
    varies, last = session.freedom, stages[-1]
    found = uninterrupted(
        fit(session.model, session.campaign, varies=varies, starts=(start,), stages=stages)
    )
    problem = last.misfit(session.model, thinned(session.campaign, last.stride), varies)
    data = found.cost - problem.prior(found.x)
    return Refit(one, session, found, data / max(problem.values, 1), problem.values)


def _start(scene: Scene, session: Session, one: Hypothesis | None) -> Real:
    more = len(session.model.parameters) - len(scene.theta)
    theta = np.append(scene.theta, np.zeros(more))
    if one is not None:
        names = [parameter.name for parameter in session.model.parameters]
        for name, value in one.begin.items():
            theta[names.index(name)] = value
    return theta


def finish(found: Refit, jobs: int = 1, width: int | None = None) -> tuple[Fit, HeldOut | None]:
    """The same on all lines, and with each fold of lines left out.

    Args:
        found: one line in four.
        jobs: threads.
        width: lines in a block; by the modes of this model if None.
    """
    session = found.session
    whole = uninterrupted(
        fit(
            session.model,
            session.campaign,
            varies=session.freedom,
            starts=(found.fit.theta,),
            stages=_WHOLE,
            jobs=jobs,
        )
    )
    return whole, fit_held_out(session.model, whole, session.campaign, jobs=jobs, width=width)


def uninterrupted(found: Fit) -> Fit:
    """The fit, if nobody broke it off: half a fit would be a verdict on nothing.

    Raises:
        KeyboardInterrupt: it was.
    """
    if found.outcome == "interrupted":
        raise KeyboardInterrupt
    return found
