"""Diagnosis as a whole: gates, a fit, scores, refits, and the verdict that they come to."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from diagnosis.effects import EFFECTS
from diagnosis.gate import Gate, hypothesis_of, sensor_gate
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.judge import NOTHING, Judged, judge
from diagnosis.refit import FIRST, LAST, PATIENT, Refit, finish, go_on, refit, uninterrupted
from diagnosis.score import Score, scores
from tuning import (
    STAGES,
    ChannelGaps,
    Fit,
    Gap,
    HeldOut,
    Session,
    channel_gaps,
    fit,
    predict,
    summarise,
)

_REFITTED = 6  # of the most promising, so many are fitted in full
_LEADING = 0.5  # of the best refit's gain, what goes on to the weights of the noise
STEPS = 5 + _REFITTED  # told at most
_PROMISING = 0.03  # of the best score, what is worth a refit


@dataclass(frozen=True, eq=False)
class Level:
    """A fit to all lines, and how far it is from what was measured.

    Args:
        fit: to all lines.
        held_out: with folds left out; None if the band is too narrow.
        gap: on held-out lines, or on all if there are none.
        channels: the same of each channel.
    """

    fit: Fit
    held_out: HeldOut | None
    gap: Gap
    channels: ChannelGaps

    @property
    def width(self) -> int | None:
        """Lines in a block; None without held-out lines."""
        return None if self.held_out is None else self.held_out.width


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """All that led to a verdict.

    Args:
        session: what was opened, without dead channels.
        gate: what sensors alone say.
        base: what was fitted without any effect, and where that ended.
        nothing: refit without any effect, on channels that no gate took out.
        scores: of all hypotheses, the most promising first; empty where nothing is missing.
        begun: first refits, with some allowance, of the most promising.
        refits: in full, of the few best of these.
        judged: their probabilities.
        as_drawn: gap of the drawing.
        retuned: stiffness, damping and tolerances fitted to all that was measured.
        after: the same with the first cause; None without one.
    """

    session: Session
    gate: Gate
    base: Scene
    nothing: Refit
    scores: tuple[Score, ...]
    begun: tuple[Refit, ...]
    refits: tuple[Refit, ...]
    judged: Judged
    as_drawn: Gap
    retuned: Level
    after: Level | None


def diagnose(
    session: Session, *, jobs: int = 1, tell: Callable[[str], None] | None = None
) -> Diagnosis:
    """Say what the model lacks, where, and how far the gap shrinks with it.

    Args:
        session: campaign and drawn model.
        jobs: threads; the verdict does not depend on it.
        tell: told what is being done.
    """
    say = tell or (lambda _: None)
    say("sensors among each other")
    gate = sensor_gate(session.campaign)
    session = replace(session, campaign=gate.alive)
    say("fit with an allowance")
    clean = replace(session, campaign=gate.campaign)
    early = uninterrupted(
        fit(clean.model, clean.campaign, varies=clean.freedom, stages=STAGES[:3], jobs=jobs)
    )
    scene = Scene(clean, early.theta)
    say("refit without any effect")
    first = refit(scene, None, clean.campaign, FIRST)
    nothing = go_on(scene, first, PATIENT)
    made = [one for f in gate.faults if (one := hypothesis_of(f, session.campaign)) is not None]
    scored: list[Score] = []
    refits: list[Refit] = []
    begun: tuple[Refit, ...] = ()
    if nothing.chi_square > NOTHING:
        say("scores of all hypotheses")
        taken = {one.location for one in made}
        proposed = [one for propose in EFFECTS.values() for one in propose(scene)]
        scored = scores(scene, early, [one for one in proposed if one.location not in taken])
        for one in _promising(scored):
            say(f"refit: {one.words}")
            refits.append(refit(scene, one, clean.campaign, FIRST))
        begun = tuple(refits)
        refits = [go_on(scene, one, LAST) for one in _leading(first, begun)]
    judged = judge(nothing, refits, made, scored)
    say("the gap on held-out lines")
    base = Scene(clean, nothing.fit.theta)
    proven = clean.campaign is not session.campaign
    known = {} if proven else {one.hypothesis: one for one in (nothing, *refits)}
    retuned = _level(base, None, session, known, jobs)
    best, width = judged.best, retuned.width
    after = None if best is None else _level(base, best, session, known, jobs, width)
    drawn = predict(session.model, session.model.drawn, session.campaign)
    return Diagnosis(
        session=session,
        gate=gate,
        base=base,
        nothing=nothing,
        scores=tuple(scored),
        begun=begun,
        refits=tuple(refits),
        judged=judged,
        as_drawn=summarise(channel_gaps(drawn, session.campaign)),
        retuned=retuned,
        after=after,
    )


def _promising(scored: Sequence[Score]) -> list[Hypothesis]:
    """The best hypothesis of each effect and place, of those with the highest scores."""
    found: dict[tuple[str, str], Score] = {}
    for score in scored:
        key = score.hypothesis.effect, score.hypothesis.location
        if key not in found and score.gain > _PROMISING * scored[0].gain:
            found[key] = score
    return [score.hypothesis for score in list(found.values())[:_REFITTED]]


def _leading(nothing: Refit, refits: Sequence[Refit]) -> list[Refit]:
    """Those that, with some allowance still, gain nearly as much as the best."""
    gains = [nothing.cost - one.cost for one in refits]
    least = _LEADING * max(gains, default=0.0)
    order = sorted(range(len(refits)), key=lambda k: -gains[k])
    return [refits[k] for k in order if gains[k] >= least]


def level_of(found: Diagnosis, one: Hypothesis, jobs: int = 1) -> Level:
    """The gap with a hypothesis, whether it was among the best or not.

    Args:
        found: the diagnosis.
        one: the hypothesis.
        jobs: threads.
    """
    return _level(found.base, one, found.session, {}, jobs, found.retuned.width)


def _level(
    base: Scene,
    one: Hypothesis | None,
    whole: Session,
    known: Mapping[Hypothesis | None, Refit],
    jobs: int,
    width: int | None = None,
) -> Level:
    """Fit to all that was measured, from a refit that is known or from the base."""
    made = known.get(one) or refit(base, one, whole.campaign, (*FIRST, *LAST))
    session = made.session
    found, held = finish(made, jobs, width)
    predicted = (
        predict(session.model, found.theta, session.campaign)
        if held is None
        else held.predict(session.model, session.campaign)
    )
    channels = channel_gaps(predicted, session.campaign)
    return Level(found, held, summarise(channels), channels)
