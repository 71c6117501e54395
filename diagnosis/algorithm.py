"""Diagnosis as a whole: gates, a fit, scores, refits, and the verdict that they come to."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from diagnosis.comparison.collect import gathered
from diagnosis.comparison.confounded import find_confounded
from diagnosis.comparison.present import join_present, present_hypotheses
from diagnosis.comparison.rivals import judge_rivals
from diagnosis.data_checks.bending import proven_hypotheses, refit_bending
from diagnosis.data_checks.sensors import Gate, sensor_gate
from diagnosis.effects import catalogue
from diagnosis.estimates.held_out_gap import HeldOutGap, begun, level, levels
from diagnosis.estimates.intervals import Known
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.inference.calibration import calibrated
from diagnosis.inference.evidence import BENDS, Evidence
from diagnosis.inference.posterior import Posterior
from diagnosis.null_model import (
    fit_with_floor,
    from_where_others_ended,
    refit_by_more_lines,
    refit_null_model,
    with_outliers,
    within_bounds,
)
from diagnosis.refits.refitting import Refit
from diagnosis.released_session import release_session
from diagnosis.search.ladder import Search
from diagnosis.search.second_effect import searched
from identification import find_overstated_noise, remove_overstated_noise
from identification.words import UsageError
from tuning import Gap, Session, channel_gaps, predict, summarise_gaps

_FEWEST = 8  # lines: of fewer any shape along frequency fits


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
    judged: Posterior
    present: tuple[Hypothesis, ...]
    twins: tuple[tuple[str, str], ...]
    as_drawn: Gap
    retuned: HeldOutGap
    after: HeldOutGap | None
    known: Known | None = None

    def __repr__(self) -> str:
        """Return campaign, verdict and causes in one line."""
        causes = ", ".join("@".join(key[:2]) for key in self.judged.present) or "no cause"
        return f"diagnosis of {self.session.campaign.name}: {self.judged.word}, {causes}"


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
    changing = find_overstated_noise(session.campaign)
    session = replace(session, campaign=remove_overstated_noise(session.campaign, changing))
    gate = sensor_gate(session.campaign)
    session, held = release_session(replace(session, campaign=gate.alive))
    scene, early = fit_with_floor(session, gate, held, jobs, say)
    made = proven_hypotheses(gate, session)
    shaped = None
    if any(one.effect == BENDS and one.is_held for one in made):
        shaped = refit_bending(scene, gate, session, say)
        if shaped is None:
            gate = gate.solid()
            scene, early = fit_with_floor(session, gate, held, jobs, say)
        made = proven_hypotheses(gate, session, 1.0 if shaped is None else shaped[1])
    clean = scene.session
    scene, first, nothing = refit_by_more_lines(*refit_null_model(scene, say))
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

    found, evidence, judged = judge_rivals(scene, found, read, say)
    present = present_hypotheses(judged, made, found)
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
    one = join_present(present, found) if is_held else None
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
        twins=find_confounded(scene, first.fit, evidence, judged, found),
        as_drawn=summarise_gaps(channel_gaps(drawn, session.campaign)),
        retuned=retuned,
        after=after,
        known=worth,
    )


def level_of(found: Diagnosis, one: Hypothesis, jobs: int = 1) -> HeldOutGap:
    """The gap with a hypothesis, whether it was among the best or not.

    Args:
        found: the diagnosis.
        one: the hypothesis.
        jobs: processes and threads.
    """
    base = replace(found.base, jobs=jobs)
    return level(base, begun(base, one, found.session), found.retuned.width)
