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
    session, directions = release_session(replace(session, campaign=gate.alive))
    scene, early = fit_with_floor(session, gate, directions, jobs, say)
    faults = proven_hypotheses(gate, session)
    bending = None
    if any(fault.effect == BENDS and fault.is_held for fault in faults):
        bending = refit_bending(scene, gate, session, say)
        if bending is None:
            gate = gate.solid()
            scene, early = fit_with_floor(session, gate, directions, jobs, say)
        faults = proven_hypotheses(gate, session, 1.0 if bending is None else bending[1])
    clean = scene.session
    scene, first, null_refit = refit_by_more_lines(*refit_null_model(scene, say))
    usual, outlier = scene, calibrated().outlier
    if not null_refit.is_noise:
        scene, null_refit = with_outliers(scene, null_refit, outlier)
    search = Search()
    # A flexible body drives all others in ways that no Part holds, so its residual tells nothing.
    if not null_refit.is_noise and not gate.flexible:
        locations = {fault.location for fault in faults}
        proposals = (hypothesis for effect in catalogue().values() for hypothesis in effect(scene))
        candidates = [
            hypothesis for hypothesis in proposals if hypothesis.location not in locations
        ]
        search = searched(scene, (early, first, null_refit), candidates, say)
        null_refit = from_where_others_ended(scene, first, null_refit, search)

    def read(tried: Search) -> Evidence:
        return gathered(scene, gate, faults, null_refit, tried, len(changing))

    search, evidence, posterior = judge_rivals(scene, search, read, say)
    present = present_hypotheses(posterior, faults, search)
    say("the gap on held-out lines")
    # With a flexible body, the fit without its mode has moved away from the machine.
    theta = early.theta if gate.flexible else null_refit.fit.theta
    base = replace(usual, theta=theta)
    # An error of 5 % is negligible in a large gap; where next to nothing remains, the third digit
    # counts, and lines that were left out beside a sharp mode cost that much.
    exact = not present
    is_corrected = clean.campaign is not session.campaign
    refits = (null_refit, *search.refits, *search.pairs)
    known_refits = {} if is_corrected else {refit.hypothesis: refit for refit in refits}
    if bending is not None and gate.undoubted is gate.alive and len(faults) == 1:
        known_refits[faults[0]] = bending[0]
    is_held = bool(present) and all(cause.is_held for cause in present)
    cause = join_present(present, search) if is_held else None
    known_refits = {
        hypothesis: within_bounds(usual, known_refits[hypothesis], outlier)
        for hypothesis in {None, cause} & known_refits.keys()
    }
    retuned, after, intervals = levels(base, cause, session, known_refits, exact=exact)
    drawn = predict(session.model, session.model.drawn, session.campaign)
    return Diagnosis(
        session=session,
        gate=gate,
        base=base,
        nothing=null_refit,
        search=search,
        evidence=evidence,
        judged=posterior,
        present=present,
        twins=find_confounded(scene, first.fit, evidence, posterior, search),
        as_drawn=summarise_gaps(channel_gaps(drawn, session.campaign)),
        retuned=retuned,
        after=after,
        known=intervals,
    )


def level_of(diagnosis: Diagnosis, hypothesis: Hypothesis, jobs: int = 1) -> HeldOutGap:
    """Return the gap with a hypothesis, whether it was among the best or not.

    Args:
        diagnosis: the diagnosis.
        hypothesis: the hypothesis that is added.
        jobs: number of processes and threads.
    """
    base = replace(diagnosis.base, jobs=jobs)
    return level(base, begun(base, hypothesis, diagnosis.session), diagnosis.retuned.width)
