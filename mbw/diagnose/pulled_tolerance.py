"""Sentence on tolerances beyond their usual bound, if nothing is missing."""

import numpy as np

from diagnosis import Diagnosis, Verdict
from tuning import TOLERANCE_BOUND_SIGMA

_MAX_NAMED_TOLERANCES = 3  # tolerances that the sentence names


def pull_sentence(verdict: Verdict, diagnosis: Diagnosis) -> str | None:
    """Return a sentence on tolerances that a verdict "none" puts beyond their usual bound.

    Among some 300 tolerances, normal with unit standard deviation, four exceed 2.5 standard
    deviations by chance. The null model allows them up to ``outlier_sigma``.

    Args:
        verdict: verdict of the diagnosis.
        diagnosis: diagnosis with its fits.

    Returns:
        The sentence; None if something is missing, or no tolerance is beyond.
    """
    if verdict.verdict != "none":
        return None
    fit, outlier = diagnosis.null.fit, diagnosis.settings.outlier_sigma
    sizes = np.where(fit.parametrisation.has_prior, np.abs(fit.x), 0.0)
    names = fit.parametrisation.names
    pulls = [
        f"a pull of {sizes[k]:.1f} for {names[k]}"
        for k in np.argsort(-sizes)[:_MAX_NAMED_TOLERANCES]
        if sizes[k] > TOLERANCE_BOUND_SIGMA
    ]
    if not pulls:
        return None
    return (
        f"This verdict accepts {', '.join(pulls)} (shift in standard deviations of the prior): "
        f"among many tolerances, pulls up to {outlier:g} occur by chance."
    )
