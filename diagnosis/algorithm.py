"""The diagnosis as a whole."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from diagnosis.data_checks.check_data import check_data
from diagnosis.data_checks.sensors import SensorChecks
from diagnosis.decision.established import Present, describe_present
from diagnosis.decision.held_out_check import admit_predictive_causes
from diagnosis.estimates.gap_by_level import LevelGapRow, estimate_gaps_by_level
from diagnosis.estimates.held_out_gap import GapEstimates, HeldOutGap, hold_out
from diagnosis.estimates.intervals import FittedParameters
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.inference.evidence import Evidence
from diagnosis.inference.posterior import Posterior
from diagnosis.null_model import fit_baseline
from diagnosis.refit_record import RefitRecord
from diagnosis.refits.refit import Refit
from diagnosis.refits.refitting import add_cause, run_refits
from diagnosis.search.collect import collect_evidence
from diagnosis.search.fitted_sets import Search, find_confounded
from diagnosis.search.selection import admit_outliers_beside_causes, refit_null_model, select_causes
from diagnosis.settings import SETTINGS, DiagnosisSettings
from diagnosis.states import check_data_after, search_before
from tuning import Checkpoint, Gap, Session, channel_gaps, predict, summarise_gaps


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Everything that led to a verdict.

    Args:
        session: campaign without useless channels, and nominal model.
        checks: faults that redundant channels prove.
        scene: campaign, model and theta of the null model.
        search: null model and sets of causes that were fitted.
        evidence: fits as plain numbers.
        posterior: probabilities.
        present: causes that the verdict names, with what each closes.
        twins: pairs of confounded causes.
        as_drawn: gap of the nominal model.
        gaps: gap of the null model and with all present causes, on held-out lines.
        level_gaps: gap at each level of the hits and at one left out (``estimate_gaps_by_level``).
        gross_hypotheses: hypotheses of the proven faults.
        settings: thresholds and sizes of the search.
    """

    session: Session
    checks: SensorChecks
    scene: Scene
    search: Search
    evidence: Evidence
    posterior: Posterior
    present: Present
    twins: tuple[tuple[str, str], ...]
    as_drawn: Gap
    gaps: GapEstimates
    level_gaps: tuple[list[LevelGapRow], LevelGapRow | None] = ([], None)
    gross_hypotheses: tuple[Hypothesis, ...] = ()
    settings: DiagnosisSettings = SETTINGS

    @property
    def null(self) -> Refit:
        """Null model."""
        return self.search.null

    @property
    def retuned(self) -> HeldOutGap:
        """Gap of the null model."""
        return self.gaps.retuned

    @property
    def after(self) -> HeldOutGap | None:
        """Gap with all present causes; None without one."""
        return self.gaps.after

    @property
    def parameters(self) -> FittedParameters | None:
        """Parameters with all present causes; None without one."""
        return self.gaps.parameters

    def __repr__(self) -> str:
        """Return campaign, verdict and causes in one line."""
        causes = ", ".join(cause.site for cause in self.present.causes) or "no cause"
        return f"diagnosis of {self.session.campaign.name}: {self.present.word}, {causes}"


def diagnose(
    session: Session,
    *,
    jobs: int = 1,
    tell: Callable[[str], None] | None = None,
    settings: DiagnosisSettings = SETTINGS,
    checkpoint: Checkpoint | None = None,
) -> Diagnosis:
    """Find what the model lacks, where, and how far the gap shrinks with it.

    Where tests state that they were made before or after a change, the machine before is fitted to
    its own tests first. The steps then compare the tests after with that machine, and with what it
    lacked in dynamic stiffness (``states``).

    1. Data checks compare channels without a model, and take gross faults out of the data.
    2. The null model is fitted: stiffness, damping and tolerances, at the model error that its
       residual shows.
    3. A score test ranks every effect of the catalogue at every place.
    4. The most promising are refitted, each at its own model error; the value of a cause is the
       decrease of that error.
    5. The best cause stays if it is material and more probable than no cause; the search then
       continues from the model that has it, for up to five causes.
    6. Each earlier cause is left out in turn, and dropped if the others explain as much, or
       replaced if another cause explains more; all are moved to neighbouring bodies.
    7. A free force is fitted at every place: that with the largest gain locates the gap, or the
       rest. Each round of the search refits the effects there, if it is at one place: those in
       its direction from their fits in dynamic stiffness.
    8. The posterior weighs all sets of causes, by the number of independent values of the residual.
    9. The gap is estimated on held-out lines, without and with the causes; a set that does not
       predict them is rejected.
    10. Causes that are probable, close a fifth of the gap and have a size are established; what
        remains is the rest.

    Args:
        jobs: processes and threads; the verdict does not depend on it.
        tell: called with the current step.
        checkpoint: finished refits, which are not repeated.

    Raises:
        UsageError: the band holds too few lines.
    """
    say = tell or (lambda _: None)
    say("hits and sensors compared with each other")
    data = check_data(session, settings)
    record = None if checkpoint is None else RefitRecord(checkpoint)
    if session.campaign.has_states:
        say("the tests before the change")
        before = search_before(fit_baseline(data, jobs, settings, record), settings, say)
        data = check_data_after(session, before, settings)
    say("null model: stiffness, damping and tolerances")
    base = fit_baseline(data, jobs, settings, record)
    search = select_causes(base, settings, say)
    search = refit_null_model(base, search, settings)
    search = admit_outliers_beside_causes(base, search, settings)
    say("unknown forces at every place")
    evidence = collect_evidence(base, search, data.unsteady, settings)
    say("the gap on held-out lines")
    evidence, posterior, gaps = admit_predictive_causes(
        base, data.session, search, evidence, settings
    )
    present = describe_present(base, search, evidence, posterior, gaps, settings)
    nominal = predict(data.session.model, data.session.parametrisation.fixed, data.session.campaign)
    return Diagnosis(
        session=data.session,
        checks=base.checks,
        scene=replace(base.scene, record=None),
        search=search,
        evidence=evidence,
        posterior=posterior,
        present=present,
        twins=find_confounded(base.scene, search, posterior, settings),
        as_drawn=summarise_gaps(channel_gaps(nominal, data.session.campaign)),
        gaps=gaps,
        level_gaps=estimate_gaps_by_level(base.scene, gaps),
        gross_hypotheses=base.proven,
        settings=settings,
    )


def estimate_gap_with(diagnosis: Diagnosis, hypothesis: Hypothesis, jobs: int = 1) -> HeldOutGap:
    """Return the held-out gap with a hypothesis, whether the search refitted it or not.

    Args:
        hypothesis: the hypothesis that is added.
        jobs: number of processes and threads.
    """
    scene = replace(diagnosis.scene, jobs=jobs)
    task = add_cause(diagnosis.retuned.refit, hypothesis)
    (refit,) = run_refits(scene, [task], diagnosis.settings.schedule)
    return hold_out(scene, refit)
