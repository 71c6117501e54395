"""Delete-group jackknife: intervals from values without one group of the data each."""

import numpy as np
from scipy.stats import t as student

from identification.words import Real


def estimate_jackknife(
    whole: float | None, without: list[float | None]
) -> tuple[float, float] | None:
    """Return the 95 % interval of a number, by Student's t with the number of groups less one.

    Args:
        whole: value from all groups.
        without: values without one group each.

    Returns:
        Both ends; None if a value is unknown.
    """
    values: Real = np.array([value for value in without if value is not None])
    count = len(without)
    if whole is None or count < 2 or len(values) < count:
        return None
    deviation = np.sqrt((count - 1) / count * ((values - values.mean()) ** 2).sum())
    half = float(student.ppf(0.975, count - 1) * deviation)
    return whole - half, whole + half


def estimate_size_jackknife(
    whole: float | None, without: list[float | None]
) -> tuple[float, float] | None:
    """Return the jackknife interval of a positive number, by its logarithm."""
    if not whole or not all(without):
        return None
    spread = estimate_jackknife(
        float(np.log(whole)), [None if value is None else float(np.log(value)) for value in without]
    )
    return None if spread is None else (float(np.exp(spread[0])), float(np.exp(spread[1])))
