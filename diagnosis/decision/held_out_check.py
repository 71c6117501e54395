"""Causes that predict held-out lines: cross-validation of the most probable set.

A set of causes may absorb errors of a real machine that it does not cause. Such a fit is hardly
better on lines that it did not see. There a set must be more probable than no cause,

    N (c_before - c_after) > n_S ln M,

c being the mean -ln L per value on held-out lines, each block of neighbouring lines at the floor
of its own residuals: at one floor for all lines, the few that a fit misses by far would decide. N
is the number of independent values of the fit with the causes, at least one for each block, whose
error is seen apart from that of all others, and the rest as in ``diagnosis.inference.posterior``:
on lines that they were not fitted to, parameters gain nothing by chance, and pay nothing. The
residuals on held-out lines are no measure of N, since they hold the errors of the parameters too.

A set fails too if it closes nothing of the gap on these lines. A set that fails is rejected, with
every set that contains it, and the most probable one of the others is checked (cross-validation of
a log score: Stone 1974, Gneiting and Raftery 2007). Of a gap that is hardly visible on held-out
lines, the fits alone decide.
"""

from dataclasses import replace

import numpy as np

from diagnosis.decision.established import find_present
from diagnosis.estimates.held_out_gap import (
    GapEstimates,
    HeldOutGap,
    estimate_gaps,
    fit_whole_null,
)
from diagnosis.inference.calibration import load_calibration
from diagnosis.inference.evidence import Evidence
from diagnosis.inference.posterior import Posterior, compute_posterior
from diagnosis.null_model import Baseline
from diagnosis.search.fitted_sets import Search
from diagnosis.settings import DiagnosisSettings
from tuning import Session, is_gap_visible, residual_statistics


def admit_predictive_causes(
    base: Baseline, whole: Session, search: Search, evidence: Evidence, settings: DiagnosisSettings
) -> tuple[Evidence, Posterior, GapEstimates]:
    """Return evidence and posterior of the sets that are admitted, and the gaps of the best.

    Args:
        base: null model, and proven faults.
        whole: session with all channels.
        settings: thresholds and schedules.
    """
    corrected: HeldOutGap | None = None
    null = fit_whole_null(base, whole, search.null)
    while True:
        posterior = compute_posterior(evidence, settings=settings)
        best = find_present(search, evidence, posterior, settings)
        gaps = estimate_gaps(base, whole, null, best, settings)
        after = gaps.after
        if not best.causes or after is None:
            return evidence, posterior, gaps
        before: HeldOutGap | None = gaps.retuned
        if base.proven:  # corrected in every set: they are no merit of the further causes
            if corrected is None:
                corrected = estimate_gaps(base, whole, null, search.null, settings).after
            before = corrected
            gaps = replace(gaps, corrected=corrected)
        price = evidence.price_causes(best.keys)
        if before is None or predicts_held_out(before, after, price):
            return evidence, posterior, gaps
        evidence = evidence.model_copy(update={"rejected": (*evidence.rejected, best.keys)})


def predicts_held_out(before: HeldOutGap, after: HeldOutGap, price: float) -> bool:
    """Return whether a set of causes predicts held-out lines well enough.

    Args:
        before: gap without the causes.
        after: gap with them.
        price: what the prior takes for the causes [nats].
    """
    excess = before.gap.excess
    if excess is None or not is_gap_visible(excess**2 - 1):
        return True
    if after.gap.excess is not None and after.gap.excess >= excess:
        return False
    first, last = (_mean_cost(gap) for gap in (before, after))
    if first is None or last is None:
        return True
    count = max(after.refit.summary.count_independent(load_calibration()), len(after.starts))
    return count * (first - last) > price


def _mean_cost(gap: HeldOutGap) -> float | None:
    """Return the mean -ln L per value, each block at its own floor; None where nothing moves."""
    count = len(gap.campaign.freq_hz)
    spans = zip(gap.starts, [*gap.starts[1:], count], strict=True)
    statistics = [
        residual_statistics(
            [values[start:stop] for values in gap.predicted],
            gap.campaign.select_lines(slice(start, stop)),
        )
        for start, stop in spans
    ]
    blocks = [(block.cost, block.values) for block in statistics if block is not None]
    if not blocks:
        return None
    costs, counts = zip(*blocks, strict=True)
    return float(np.average(costs, weights=counts))
