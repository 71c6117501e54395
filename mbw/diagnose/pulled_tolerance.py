"""Why a model is still off where nothing is missing: a tolerance that wants more than its bound."""

import numpy as np

from diagnosis import Diagnosis, Verdict
from diagnosis.inference.calibration import calibrated
from tuning import BOUND

_OFF = 1.1  # excess below which a re-tuned model is not off
_FEW = 3


def pulled_sentence(verdict: Verdict, found: Diagnosis) -> str | None:
    """Which tolerances the verdict believes to be beyond the bound that the gap keeps them in.

    Of some 300 tolerances z_i, normal with one standard deviation each, four are beyond 2.5. The
    judgement lets them go to the outlier that it was calibrated with, the gap does not.

    Args:
        verdict: what was found.
        found: the diagnosis.

    Returns:
        One sentence; None where something is missing, the model is not off, or none is beyond.
    """
    off = verdict.gap.retuned.excess
    if verdict.verdict != "none" or off is None or off < _OFF:
        return None
    fit, outlier = found.nothing.fit, calibrated().outlier
    sizes = np.where(fit.freedom.has_prior, np.abs(fit.x), 0.0)
    names = fit.freedom.names
    pulls = [
        f"{names[k]} to be off by {sizes[k]:.1f}"
        for k in np.argsort(-sizes)[:_FEW]
        if sizes[k] > BOUND
    ]
    if not pulls and BOUND < found.evidence.pull <= outlier:
        pulls = [f"a tolerance to be off by {found.evidence.pull:.1f}"]
    if not pulls:
        return None
    return (
        f"This verdict believes {', '.join(pulls)} standard deviations, as up to {outlier:g} may "
        f"be where tolerances are many; with each kept within {BOUND:g}, as in these figures, the "
        f"model stays off by {off:.3g} times the noise."
    )
