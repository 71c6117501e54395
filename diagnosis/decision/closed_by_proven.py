"""Part of the gap that each fault closes which redundant channels prove.

Such faults are corrected in every set of causes, so that no set lacks one. With e(D) the mean
square of the gap of the uncorrected data over that of the noise, and e(S) that of the set, let d_k
be the difference of e(S) if the fault k alone is not corrected, at the parameters of the set. The
fault closes the larger of

    d_k / [e(D) - 1],   d_k / (sum d) [e(D) - e(P)] / [e(D) - 1],

where e(P) is the gap of the null model with all these faults corrected. The first is the part that
the fault closes as the last one, the second as the first. A wrong channel misleads the null model,
whose gap may then be much larger than d_k.
"""

from collections.abc import Mapping

import numpy as np

from diagnosis.estimates.held_out_gap import GapEstimates, HeldOutGap
from diagnosis.hypothesis import Hypothesis
from diagnosis.inference.evidence import Key
from diagnosis.null_model import Baseline
from tuning import TOLERANCE_BOUND_SIGMA, channel_gaps, predict, summarise_gaps


def find_closed_by_proven(base: Baseline, gaps: GapEstimates) -> dict[Key, float]:
    """Return the part of the gap that each proven fault closes; 1 if it cannot be told."""
    after = gaps.after
    if not base.proven or after is None:
        return {}
    excess = {
        cause.key: _find_excess_without(cause, after, gaps.retuned)
        for cause in base.proven
        if cause.is_modelled and cause.reform is None
    }
    corrected = (gaps.corrected or after).gap.excess
    before, least = gaps.retuned.gap.excess, after.gap.excess
    complete = {cause.key: 1.0 for cause in base.proven}
    if before is None or least is None or corrected is None or before <= 1:
        return complete
    without = {key: value**2 for key, value in excess.items() if value is not None}
    drop = before**2 - corrected**2 if len(without) == len(complete) else 0.0
    return complete | divide_closed_gap(without, least**2, before**2 - 1, drop)


def divide_closed_gap(
    without: Mapping[Key, float], least: float, gap: float, drop: float
) -> dict[Key, float]:
    """Return the part of the gap that each fault closes.

    Args:
        without: e if one fault is not corrected, by its key.
        least: e(S), with all causes.
        gap: e(D) - 1.
        drop: e(D) - e(P), where all faults are corrected; 0 if that is not known.
    """
    differences = {key: max(level - least, 0.0) for key, level in without.items()}
    total = max(sum(differences.values()), np.finfo(float).tiny)
    return {key: max(d, d / total * drop) / gap for key, d in differences.items()}


def _find_excess_without(cause: Hypothesis, after: HeldOutGap, retuned: HeldOutGap) -> float | None:
    """Return the excess with all causes but one, whose tolerances are clipped to their bounds."""
    refit, campaign = after.refit, after.campaign
    parametrisation = refit.fit.parametrisation
    released = np.isin(np.array(parametrisation.names), cause.release)
    bounded = np.clip(refit.fit.x, -TOLERANCE_BOUND_SIGMA, TOLERANCE_BOUND_SIGMA)
    theta = parametrisation.theta(np.where(released, bounded, refit.fit.x))
    if cause.correct is not None:
        campaign = retuned.campaign
    predicted = predict(refit.session.model, theta, campaign)
    return summarise_gaps(channel_gaps(predicted, campaign)).excess
