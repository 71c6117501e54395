"""Sentences on tolerances at their bounds, and beyond their usual bound if nothing is missing."""

import numpy as np

from diagnosis import Diagnosis, Verdict
from mbw.remarks import at_bound_sentence, join_first
from tuning import TOLERANCE_BOUND_SIGMA

_MAX_NAMED_TOLERANCES = 3  # tolerances that the sentence names


def pull_sentence(verdict: Verdict, diagnosis: Diagnosis) -> str | None:
    """Return a sentence on tolerances that a verdict "none" puts beyond their usual bound.

    Among some 300 tolerances, normal with unit standard deviation, four exceed 2.5 standard
    deviations by chance. The null model allows them up to ``outlier_sigma``.

    Returns:
        The sentence; None if something is missing, or no tolerance is beyond.
    """
    if verdict.verdict != "none":
        return None
    fit, outlier = diagnosis.null.fit, diagnosis.settings.outlier_sigma
    sizes = np.where(fit.parametrisation.is_tolerance, np.abs(fit.x), 0.0)
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


def bound_sentence(diagnosis: Diagnosis) -> str | None:
    """Return a sentence on tolerances at their bounds in the fit behind the verdict's figures.

    It is the fit with the present causes, or that of the null model without one.

    Returns:
        The sentence; None if no tolerance ended at its bound.
    """
    fit = (diagnosis.after or diagnosis.retuned).refit.fit
    varies = fit.parametrisation
    is_at_bound = varies.is_tolerance & varies.coordinates_at_bound(fit.x)
    names = [f"{varies.names[k]} {fit.x[k]:+.1f}" for k in np.flatnonzero(is_at_bound)]
    if not names:
        return None
    what = "with the present causes" if diagnosis.after else "of the re-tuned model"
    return at_bound_sentence(len(names), f" in the fit {what}: {join_first(names)}")
