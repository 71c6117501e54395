"""Matrices of several parameters side by side, so that one product serves all of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Integers, Real


@dataclass(frozen=True, eq=False)
class ParameterGroup:
    """Matrices K of parameters that stand side by side.

    Args:
        indices: numbers of the parameters among the chosen.
        count: number of parameters.
        matrix: K; (m, n count).
    """

    indices: Integers | slice
    count: int
    matrix: Real


def stack_parameters(terms: Sequence[tuple[Integers, Real]]) -> ParameterGroup:
    """Return matrices of several Parts side by side, summed if a parameter occurs twice."""
    indices = np.concatenate([of_part for of_part, _ in terms])
    matrices = np.concatenate([of_part for _, of_part in terms])
    numbers, inverse = np.unique(indices, return_inverse=True)
    if len(numbers) < len(indices):
        summed = np.zeros((len(numbers), *matrices.shape[1:]))
        np.add.at(summed, inverse, matrices)
        indices, matrices = numbers, summed
    flat = np.ascontiguousarray(matrices.transpose(2, 1, 0))
    return ParameterGroup(as_slice(indices), len(indices), flat.reshape(len(flat), -1))


def as_slice(indices: Integers) -> Integers | slice:
    """Return evenly spaced indices as a slice, which is quicker to add to."""
    steps = np.unique(np.diff(indices))
    if len(steps) > 1 or (len(steps) and steps[0] < 1) or not len(indices):
        return indices
    step = int(steps[0]) if len(steps) else 1
    return slice(int(indices[0]), int(indices[-1]) + 1, step)
