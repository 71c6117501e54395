"""Log likelihood of the residuals' differences between levels, where shared errors cancel."""

from math import log

from diagnosis.inference.calibration import Calibration
from diagnosis.inference.evidence import FittedSet


def compare_between_levels(
    fitted: FittedSet, null: FittedSet, best: FittedSet, constants: Calibration
) -> float:
    """Return the gain in log likelihood from differences of residuals between levels [nats].

    Errors that all levels share cancel in these differences. What remains is noise and the level
    dependence e that the fit does not explain (``level_dependence``). By the profile likelihood
    over its size, the gain is N ln[(1 + e_0) / (1 + e_S)], N the number of independent values at
    the share 1 / (1 + e) of the best fit. An excess that a badly known variance explains counts as
    none.

    Args:
        fitted: the fit.
        best: the fit whose residual says how many values are independent.
    """
    if fitted.level_excess is None or null.level_excess is None or best.level_excess is None:
        return 0.0
    of_null, of_fit, of_best = (
        1 + max(summary.level_excess or 0.0, fitted.doubt) for summary in (null, fitted, best)
    )
    return constants.count_independent(1 / of_best, fitted.values) * log(of_null / of_fit)
