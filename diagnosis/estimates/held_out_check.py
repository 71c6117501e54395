r"""Causes that predict held-out lines: the number of causes by cross-validation.

A set of causes may absorb errors of a real machine that it does not cause. Such a fit is hardly
better on lines that it did not see. So each cause must shrink the gap there by a factor e,

    excess_after^2 - 1 <= exp(-|S|) (excess_before^2 - 1).

A fault of survival ratio q beside errors of the power b^2 shrinks it by (1 + q^2) + q^2 / b^2,
thus by more than e from q = 1.31 on.

Otherwise sets of as many causes are not admitted, and the most probable set of fewer causes is
checked (cross-validation instead of a penalty for each parameter: Stone 1977). Of a gap that is
hardly visible on held-out lines, the fits alone decide.
"""

import numpy as np

from diagnosis.estimates.held_out_gap import GapEstimates, HeldOutGap, estimate_gaps
from diagnosis.inference.evidence import Evidence
from diagnosis.inference.posterior import Posterior, compute_posterior
from diagnosis.null_model import Baseline
from diagnosis.search.fitted_sets import Search
from diagnosis.settings import DiagnosisSettings
from diagnosis.verdict.established import find_present
from tuning import Session, is_gap_visible


def admit_predictive_causes(
    base: Baseline, whole: Session, search: Search, evidence: Evidence, settings: DiagnosisSettings
) -> tuple[Evidence, Posterior, GapEstimates]:
    """Return evidence and posterior of the sets that are admitted, and the gaps of the best.

    Args:
        base: null model, and proven faults.
        whole: session with all channels.
        search: sets of causes that were fitted.
        evidence: fits as plain numbers.
        settings: thresholds and schedules.
    """
    while True:
        posterior = compute_posterior(evidence, settings=settings)
        best = find_present(search, posterior, settings)
        gaps = estimate_gaps(base, whole, search.null, best, settings)
        if not best.causes or gaps.after is None:
            return evidence, posterior, gaps
        before: HeldOutGap | None = gaps.retuned
        if base.proven:  # corrected in every set: they are no merit of the further causes
            before = estimate_gaps(base, whole, search.null, search.null, settings).after
        count = len(best.causes)
        if before is None or predicts_held_out(before, gaps.after, count):
            return evidence, posterior, gaps
        evidence = evidence.model_copy(update={"admitted_causes": count - 1})


def predicts_held_out(before: HeldOutGap, after: HeldOutGap, causes: int) -> bool:
    """Return whether a set of causes closes enough of the gap on held-out lines.

    Args:
        before: gap without the causes.
        after: gap with them.
        causes: number of causes.
    """
    first, last = before.gap.excess, after.gap.excess
    if first is None or last is None or not is_gap_visible(first**2 - 1):
        return True
    return last**2 - 1 <= float(np.exp(-causes)) * (first**2 - 1)
