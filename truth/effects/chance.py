"""What effects draw: one of several, a number over decades, a direction in space."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from truth.machine.station import Real

_T = TypeVar("_T")


def choose(random: np.random.Generator, among: Sequence[_T]) -> _T:
    """Draw one of several with a single random number, however many there are.

    So the draws that follow do not depend on the place that is chosen from.
    """
    return among[int(random.random() * len(among))]


def log_uniform(random: np.random.Generator, limits: tuple[float, float]) -> float:
    """Draw a number whose logarithm is uniform between the limits."""
    low, high = np.log(limits)
    return float(np.exp(random.uniform(low, high)))


def sign(random: np.random.Generator) -> int:
    """Draw +1 or -1."""
    return choose(random, (1, -1))


def unit_vector(random: np.random.Generator, span: Real | None = None) -> tuple[float, ...]:
    """Draw a direction, uniform on the sphere of a space.

    Args:
        random: random numbers of the effect.
        span: vectors that span the space, one a row, (n, 3); all three axes if none.
    """
    vector = random.standard_normal(3)
    if span is not None:
        _, strengths, rows = np.linalg.svd(span)
        basis = rows[: int(np.sum(strengths > 1e-9 * strengths[0]))]
        vector = basis.T @ (basis @ vector)
    return tuple(float(part) for part in vector / np.linalg.norm(vector))
