"""Evidence of a verdict: plain numbers of everything that was fitted."""

from diagnosis.inference.calibration import find_variance_source
from diagnosis.inference.evidence import Evidence, ForceGain, Scored
from diagnosis.null_model import Baseline
from diagnosis.refits.refit import Refit
from diagnosis.search.fitted_sets import Search, find_interchangeable
from diagnosis.search.refit_round import push_about
from diagnosis.settings import DiagnosisSettings
from tuning import is_gap_visible


def collect_evidence(
    base: Baseline, search: Search, unsteady: int, settings: DiagnosisSettings
) -> Evidence:
    """Return the evidence; free forces of the rest are fitted if a rest is visible.

    Args:
        unsteady: number of tests whose machine changed from hit to hit.
    """
    null, selected = search.null, search.selected
    best_gain: dict[str, Scored] = {}
    for score in search.scores:
        effect, location, dof = score.hypothesis.key
        row = Scored(effect=effect, location=location, dof=dof, gain=score.gain)
        best_gain.setdefault(score.hypothesis.site, row)
    has_rest = bool(selected.causes) and is_gap_visible(selected.gap)

    def push(refit: Refit) -> tuple[ForceGain, ...]:
        return search.forces.get(refit) or push_about(base.scene, refit, settings)

    return Evidence(
        proven=tuple(hypothesis.key for hypothesis in base.proven),
        small_faults=search.small_faults,
        unknown=base.checks.unknown,
        null=null.summary,
        sets=tuple(refit.summary for refit in search.refits),
        pushed=push(null),
        rest_pushed=push(selected) if has_rest else (),
        hypotheses=len(best_gain),
        variance=find_variance_source(null.session.campaign),
        unsteady=unsteady,
        scored=tuple(best_gain.values()),
        interchangeable=find_interchangeable(search, base.scene.stride_factor, settings),
    )
