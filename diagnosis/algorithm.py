"""Diagnosis as a whole: gates, a fit, scores, refits, and the verdict that they come to."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

from diagnosis.comparison.collect import gathered
from diagnosis.comparison.predictive import at_ease, foretold, rivals_of
from diagnosis.data_checks.sensors import Gate, hypothesis_of, sensor_gate
from diagnosis.effects import catalogue
from diagnosis.estimates.held_out_gap import Level, begun, level, levels
from diagnosis.estimates.intervals import Known
from diagnosis.hypothesis import Hypothesis, Scene, together
from diagnosis.inference.calibration import calibrated
from diagnosis.inference.evidence import BENDS, Evidence
from diagnosis.inference.posterior import NATS, Judged, judge
from diagnosis.null_model import (
    from_many_starts,
    from_where_others_ended,
    with_outliers,
    within_bounds,
)
from diagnosis.refits.refitting import (
    FIRST,
    LAST,
    PATIENT,
    SHAPED,
    Refit,
    go_on,
    paced,
    plenty,
    refit,
    uninterrupted,
)
from diagnosis.search.ladder import Search
from diagnosis.search.score_test import cosines
from diagnosis.search.second_effect import searched
from identification import independent, steadied, unsteady
from identification.words import Campaign, UsageError
from mbmodel import Held, loosened
from tuning import (
    STAGES,
    Fit,
    Gap,
    Session,
    channel_gaps,
    fit,
    freedom,
    predict,
    summarise,
    with_tolerances,
)

_FEWEST = 8  # lines: of fewer any shape along frequency fits
_BENT = 0.3  # of the gap, what a body's mode may leave
_NEARLY = 0.5  # of the variance: where it leaves more, its frequency may begin elsewhere
_BEGINS = 1.0, 2.2, 1.5, 0.67, 3.3  # times that of the highest peak
_LITTLE = 0.1  # of the variance: where so little is left of much data, more of them count
_ALIKE = 0.9  # cosine of signatures: twins


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """All that led to a verdict.

    Args:
        session: what was opened, without channels that tell nothing.
        gate: what sensors alone say.
        base: what was fitted without any effect, and where that ended.
        nothing: refit without any effect, on channels that no gate took out.
        search: for what explains the gap; empty where there is none.
        evidence: what was judged by.
        judged: probabilities.
        present: the causes that the verdict says are there, the most probable first.
        twins: pairs of causes that leave the same, as the verdict calls them.
        as_drawn: gap of the drawing.
        retuned: stiffness, damping and tolerances fitted to all that was measured.
        after: the same with the first cause; None without one, and where no Part holds it.
        known: parameters of ``after`` and their confidence.
    """

    session: Session
    gate: Gate
    base: Scene
    nothing: Refit
    search: Search
    evidence: Evidence
    judged: Judged
    present: tuple[Hypothesis, ...]
    twins: tuple[tuple[str, str], ...]
    as_drawn: Gap
    retuned: Level
    after: Level | None
    known: Known | None = None


def diagnose(
    session: Session, *, jobs: int = 1, tell: Callable[[str], None] | None = None
) -> Diagnosis:
    """Say what the model lacks, where, and how far the gap shrinks with it.

    Args:
        session: campaign and drawn model.
        jobs: processes and threads; the verdict does not depend on it.
        tell: told what is being done.

    Raises:
        UsageError: the band holds too few lines.
    """
    count = len(session.campaign.freq_hz)
    if count < _FEWEST:
        raise UsageError(
            f"a diagnosis needs {_FEWEST} lines or more, and the band holds {count}: widen it"
        )
    say = tell or (lambda _: None)
    say("hits and sensors among each other")
    changing = unsteady(session.campaign)
    session = replace(session, campaign=steadied(session.campaign, changing))
    gate = sensor_gate(session.campaign)
    session, held = _loosened(replace(session, campaign=gate.alive))
    scene, early = _begun(session, gate, held, jobs, say)
    made = _made(gate, session)
    shaped = None
    if any(one.effect == BENDS and one.is_held for one in made):
        shaped = _bending(scene, gate, session, say)
        if shaped is None:
            gate = gate.solid()
            scene, early = _begun(session, gate, held, jobs, say)
        made = _made(gate, session, 1.0 if shaped is None else shaped[1])
    clean = scene.session
    scene, first, nothing = _closer(*_nothing(scene, say))
    usual, outlier = scene, calibrated().outlier
    if not nothing.is_noise:
        scene, nothing = with_outliers(scene, nothing, outlier)
    found = Search()
    # A body that bends drives all others in ways that no Part holds: what it leaves tells nothing.
    if not nothing.is_noise and not gate.flexible:
        taken = {one.location for one in made}
        proposed = [one for effect in catalogue().values() for one in effect(scene)]
        possible = [one for one in proposed if one.location not in taken]
        found = searched(scene, (early, first, nothing), possible, say)
        nothing = from_where_others_ended(scene, first, nothing, found)

    def read(tried: Search) -> Evidence:
        return gathered(scene, gate, made, nothing, tried, len(changing))

    found, evidence, judged = _judged(scene, found, read, say)
    present = _present(judged, made, found)
    say("the gap on held-out lines")
    # Where a body bends the fit without it has wandered.
    begin = early.theta if gate.flexible else nothing.fit.theta
    base = replace(usual, theta=begin)
    # Of a large gap 5 % do not matter; what is nearly nothing is told by the third digit, and lines
    # that were left out beside a sharp mode cost that much.
    exact = not present
    proven = clean.campaign is not session.campaign
    tried = (nothing, *found.refits, *found.pairs)
    before = {} if proven else {one.hypothesis: one for one in tried}
    if shaped is not None and gate.undoubted is gate.alive and len(made) == 1:
        before[made[0]] = shaped[0]
    is_held = bool(present) and all(one.is_held for one in present)
    one = _together(present, found) if is_held else None
    known = {None, one} & before.keys()
    before = {key: within_bounds(usual, before[key], outlier) for key in known}
    retuned, after, worth = levels(base, one, session, before, exact=exact)
    drawn = predict(session.model, session.model.drawn, session.campaign)
    return Diagnosis(
        session=session,
        gate=gate,
        base=base,
        nothing=nothing,
        search=found,
        evidence=evidence,
        judged=judged,
        present=present,
        twins=_twins(scene, first.fit, evidence, judged, found),
        as_drawn=summarise(channel_gaps(drawn, session.campaign)),
        retuned=retuned,
        after=after,
        known=worth,
    )


def _begun(
    session: Session, gate: Gate, held: tuple[Held, ...], jobs: int, say: Callable[[str], None]
) -> tuple[Scene, Fit]:
    """The fit with an allowance, to what no gate took out."""
    say("fit with an allowance")
    clean = replace(session, campaign=gate.campaign)
    pace = _pace(clean.campaign)
    early = uninterrupted(
        fit(
            clean.model,
            clean.campaign,
            varies=clean.freedom,
            stages=paced(STAGES[:3], pace),
            jobs=jobs,
        )
    )
    own = independent(session.campaign)
    return Scene(clean, early.theta, held, pace, jobs, independent=own), early


def _nothing(scene: Scene, say: Callable[[str], None]) -> tuple[Scene, Refit, Refit]:
    """First steps and the end of the fit without any effect, and the scene from where it began."""
    say("refit without any effect")
    campaign = scene.session.campaign
    first = refit(scene, None, campaign, FIRST)
    nothing = go_on(scene, first, PATIENT)
    best = from_many_starts(scene, nothing, say)
    if best.cost < nothing.cost:  # hypotheses begin there too: else they end worse than nothing
        scene, nothing = replace(scene, theta=best.fit.theta), best
        first = refit(scene, None, campaign, FIRST)
    return scene, first, nothing


def _closer(scene: Scene, first: Refit, nothing: Refit) -> tuple[Scene, Refit, Refit]:
    """The same by as many lines as of little data, where little is left of much.

    Three levels are fitted to every twelfth line: what that leaves of a strong one between them,
    0.0175 of the noise where all parameters were right, is no gap; every fourth leaves 0.0054.
    """
    if scene.pace == 1 or nothing.is_noise or nothing.gap > _LITTLE:
        return scene, first, nothing
    scene = replace(scene, pace=1)
    first = refit(scene, None, scene.session.campaign, FIRST)
    return scene, first, go_on(scene, nothing, PATIENT[-1:])


def _made(gate: Gate, session: Session, times: float = 1.0) -> list[Hypothesis]:
    """Hypotheses of what the gate has proven."""
    bending = [check.body for check in gate.flexible]
    good = gate.undoubted
    found = (hypothesis_of(fault, session, bending, good, times) for fault in gate.faults)
    return [one for one in found if one is not None]


def _bending(
    scene: Scene, gate: Gate, session: Session, say: Callable[[str], None]
) -> tuple[Refit, float] | None:
    """The refit with the modes of bodies that seem to bend, and where their frequencies began.

    They begin about the fit without them and, since that may have wandered, about the drawing.
    None where they do not explain it: where set-ups share a body's sensors, a machine that was
    another one in each of them looks like bending too.
    """
    without = refit(scene, None, gate.undoubted, (*FIRST, *LAST))
    least = _BENT * without.gap
    best: tuple[Refit, float] | None = None
    drawn = replace(scene, theta=scene.session.model.drawn)
    for start, times in product((scene, drawn), _BEGINS):
        say("bodies that bend")
        bent = [one for one in _made(gate, session, times) if one.effect == BENDS and one.is_held]
        found = refit(start, together(bent), gate.undoubted, SHAPED)
        if best is None or found.chi_square < best[0].chi_square:
            best = found, times
        if best[0].gap < min(least, _NEARLY):
            break
    return best if best is not None and best[0].gap < least else None


def _judged(
    scene: Scene, found: Search, read: Callable[[Search], Evidence], say: Callable[[str], None]
) -> tuple[Search, Evidence, Judged]:
    """What was tried, evidence, judgement; of rivals with what they foretell of unseen data.

    Args:
        scene: of the search.
        found: what was tried.
        read: the evidence of that.
        say: told what is being done.
    """
    evidence = read(found)
    eased = at_ease(scene, found, judge(evidence), calibrated().outlier)
    if eased is not found:
        found, evidence = eased, read(eased)
    judged = judge(evidence)
    rivals = rivals_of(judged, found)
    if len(rivals) < 2:
        return found, evidence, judged
    say("what rivals foretell of what their fits did not see")
    scores = foretold(scene, [one for _, one, _ in rivals])
    told = dict(zip((keys for keys, _, _ in rivals), scores, strict=True))
    update: dict[str, object] = {
        "refits": tuple(
            one.model_copy(update={"foretold": told.get((one.key,))}) for one in evidence.refits
        ),
        "pairs": tuple(
            one.model_copy(update={"foretold": told.get(one.keys)}) for one in evidence.pairs
        ),
    }
    evidence = evidence.model_copy(update=update)
    return found, evidence, judge(evidence)


def _loosened(session: Session) -> tuple[Session, tuple[Held, ...]]:
    """The session with a coordinate for each direction that the drawing holds rigid.

    A joint that only slides sits nowhere; one that may turn does, within its tolerance.
    """
    campaign = session.campaign
    machine, held = loosened(session.model.machine, float(campaign.freq_hz.max()))
    model = with_tolerances(machine, campaign)
    varies = session.freedom.extended(freedom(model, campaign.tolerance))
    return replace(session, model=model, freedom=varies), held


def _pace(campaign: Campaign) -> int:
    """How many times as much was measured as fits need."""
    return max(1, round(plenty(campaign)))


def _present(judged: Judged, made: Sequence[Hypothesis], found: Search) -> tuple[Hypothesis, ...]:
    """The hypotheses of the causes that are there: of a pair as they were fitted together."""
    known_as = {one.hypothesis.key: one.hypothesis for one in found.refits if one.hypothesis}
    known_as |= {one.key: one for one in made}
    present = set(judged.present)
    for pair in reversed(found.pairs):  # the best one last, which counts
        members = pair.hypothesis.members if pair.hypothesis else ()
        if present.issuperset(one.key for one in members):
            known_as |= {one.key: one for one in members}
    return tuple(known_as[key] for key in judged.present)


def _together(present: tuple[Hypothesis, ...], found: Search) -> Hypothesis:
    """All that is present at once, as it was fitted if it was."""
    fitted = (pair.hypothesis for pair in found.pairs if pair.hypothesis)
    known = (one for one in fitted if set(one.members) == set(present))
    return next(known, None) or together(present)


def _twins(
    scene: Scene, found: Fit, evidence: Evidence, judged: Judged, tried: Search
) -> tuple[tuple[str, str], ...]:
    """Pairs of causes whose signatures have a cosine of 0.9, or that foretell as well.

    They do where what they leave of what no fit saw differs by less than 3 nats, of as much as is
    enough for fits, as it is or by what decides anything, which are more.
    """
    costs = {one.hypothesis.identity: one.cost for one in tried.refits if one.hypothesis}
    told = {one.key: one.foretold for one in evidence.refits}
    named = {key for key, _ in judged.causes}
    leading = [
        one
        for one in tried.scores
        if one.hypothesis.key in named and one.hypothesis.identity in costs and one.step.any()
    ]
    pairs = [frozenset(map("@".join, pair)) for pair in judged.twins]
    alike = cosines(scene, found, leading, FIRST[-1].allowance) if len(leading) > 1 else None
    for i, one in enumerate(leading):
        for j, other in enumerate(leading[:i]):
            cost, less = (told.get(x.hypothesis.key) for x in (one, other))
            if cost is None or less is None:
                cost, less = (costs[x.hypothesis.identity] for x in (one, other))
            near = abs(cost - less) < NATS or (alike is not None and abs(alike[i, j]) >= _ALIKE)
            if near:
                pairs.append(frozenset((other.hypothesis.site, one.hypothesis.site)))
    order = {f"{key[0]}@{key[1]}": place for place, (key, _) in enumerate(judged.causes)}
    sites = [sorted(pair, key=lambda one: order[one]) for pair in dict.fromkeys(pairs)]
    return tuple((both[0], both[1]) for both in sites if len(both) == 2)


def level_of(found: Diagnosis, one: Hypothesis, jobs: int = 1) -> Level:
    """The gap with a hypothesis, whether it was among the best or not.

    Args:
        found: the diagnosis.
        one: the hypothesis.
        jobs: processes and threads.
    """
    base = replace(found.base, jobs=jobs)
    return level(base, begun(base, one, found.session), found.retuned.width)
