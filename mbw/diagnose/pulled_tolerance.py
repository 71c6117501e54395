"""Sentence on tolerances beyond their bound, if nothing is missing but the gap remains."""

import numpy as np

from diagnosis import Diagnosis, Verdict
from tuning import TOLERANCE_BOUND_SIGMA, is_gap_visible

_MAX_NAMED_TOLERANCES = 3  # tolerances that the sentence names


def pull_sentence(verdict: Verdict, diagnosis: Diagnosis) -> str | None:
    """Return a sentence on tolerances that the verdict puts beyond the bound of the gap.

    Among some 300 tolerances, normal with unit standard deviation, four exceed 2.5 standard
    deviations by chance. The posterior probabilities allow them up to ``outlier_sigma``, the gap
    does not.

    Args:
        verdict: verdict of the diagnosis.
        diagnosis: diagnosis with its fits.

    Returns:
        The sentence; None if something is missing, the gap is small, or no tolerance is beyond.
    """
    excess = verdict.gap.retuned.excess
    if verdict.verdict != "none" or excess is None or not is_gap_visible(excess**2 - 1):
        return None
    fit, outlier = diagnosis.null.fit, diagnosis.settings.outlier_sigma
    sizes = np.where(fit.parametrisation.has_prior, np.abs(fit.x), 0.0)
    names = fit.parametrisation.names
    pulls = [
        f"a pull of {sizes[k]:.1f} for {names[k]}"
        for k in np.argsort(-sizes)[:_MAX_NAMED_TOLERANCES]
        if sizes[k] > TOLERANCE_BOUND_SIGMA
    ]
    largest = diagnosis.evidence.largest_shift
    if not pulls and TOLERANCE_BOUND_SIGMA < largest <= outlier:
        pulls = [f"a pull of {largest:.1f} for one tolerance"]
    if not pulls:
        return None
    return (
        f"This verdict accepts {', '.join(pulls)} (shift in standard deviations of the prior): "
        f"among many tolerances, pulls up to {outlier:g} occur by chance. The figures here keep "
        f"each within {TOLERANCE_BOUND_SIGMA:g}, so that a gap of {excess:.3g} times the noise "
        "remains."
    )
