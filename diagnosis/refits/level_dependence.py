r"""How far residuals depend on the level, which no linear time-invariant machine explains.

Tests with hits of several levels at one point have one FRF on a linear machine, whatever its
errors are. With the residuals r_l of these L tests and their variances sigma_l^2, the excess

    e = \frac{1}{L - 1} \sum_l \frac{|r_l - \bar r|^2}{\sigma_l^2} - 1,
    \bar r = \frac{\sum_l r_l / \sigma_l^2}{\sum_l 1 / \sigma_l^2},

is zero in the mean for noise alone (Cochran 1954), beside any error that the levels share.
"""

from collections.abc import Sequence

import numpy as np

from identification import smooth_variance
from identification.words import Campaign, Complex, Test, group_by_key
from tuning.misfit.residual_statistics import find_counted_values


def measure_level_dependence(predicted: Sequence[Complex], campaign: Campaign) -> float | None:
    """Return e of a fit, the mean of all values; None if no point was hit at several levels.

    Args:
        predicted: FRFs of each test of the campaign, (n_line, n_output, n_input).
        campaign: measured FRFs and their variances.
    """
    groups = group_by_key((_describe_set_up(test), k) for k, test in enumerate(campaign.tests))
    total, count = 0.0, 0
    for numbers in groups.values():
        tests = [campaign.tests[number] for number in numbers]
        if len({test.condition.level_n for test in tests}) < 2:
            continue
        variance = np.array([smooth_variance(test.estimate) for test in tests])
        measured = np.array([test.estimate.frf.values for test in tests])
        residual = np.array([predicted[number] for number in numbers]) - measured
        counts = np.array([find_counted_values(test.estimate)[0] for test in tests])
        counted = (counts & (variance > 0)).all(axis=0)
        weight = 1 / np.where(counted, variance, np.inf)
        mean = (weight * residual).sum(axis=0) / np.where(counted, weight.sum(axis=0), 1.0)
        total += float((weight * np.abs(residual - mean) ** 2).sum()) / (len(tests) - 1)
        count += int(counted.sum())
    return total / count - 1 if count else None


def _describe_set_up(test: Test) -> tuple[object, ...]:
    """Return all that decides the FRFs of a test on a linear machine; the level does not."""
    condition = test.condition
    return (
        condition.reference,
        condition.setup,
        condition.spindle_speed,
        condition.variant,
        test.estimate.frf.outputs,
    )
