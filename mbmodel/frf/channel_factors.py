"""Factors of FRFs that depend on frequency: of the readings of a channel, and of all inputs."""

from collections.abc import Sequence

import numpy as np

from identification.words import Complex, Output, Real
from mbmodel.assembly import frequency_dependent_core
from mbmodel.parts import Change
from mbmodel.ports.ports import group_by_point


def output_factor(
    changes: Sequence[Change], outputs: Sequence[Output], laplace: Complex
) -> Complex | None:
    """Return the factor by which each channel's reading is multiplied, None without a change.

    Args:
        changes: changes of the slot output.
        outputs: labels of the channels.
        laplace: s [rad/s]; (n_freq,).

    Returns:
        (n_out, n_freq).
    """
    if not changes:
        return None
    channels = group_by_point(outputs)
    coefficients = np.zeros((len(outputs), 3))
    shaped: Complex = np.zeros((len(outputs), len(laplace)), np.complex128)
    for change in changes:
        if change.point not in channels:
            continue
        rows, axes = channels[change.point].rows, channels[change.point].axes
        if change.shape is None:
            coefficients[rows] += change.left[axes] @ (change.core @ change.right[0]).T
        else:
            core = frequency_dependent_core(change, laplace) @ change.right[0]
            shaped[rows] += change.left[axes] @ core.T
    for power in map(int, np.flatnonzero(coefficients.any(axis=0))):
        shaped += coefficients[:, power, None] * laplace**power
    return np.asarray(np.exp(shaped), np.complex128)


def output_selection(outputs: Sequence[Output], point: str) -> Real:
    """Return 1 where a channel reads a direction of a point, whatever its sign; (n_out, 6)."""
    matrix = np.zeros((len(outputs), 6))
    for row, dof in zip(matrix, outputs, strict=True):
        if dof.point == point:
            row[dof.axis] = 1.0
    return matrix


def input_factor(changes: Sequence[Change], laplace: Complex) -> Complex:
    """Return the factor 1 + sum of changes by which one Part multiplies all inputs; (n_freq,).

    Args:
        changes: the Part's changes of the inputs.
        laplace: s [rad/s]; (n_freq,).
    """
    factor: Complex = np.ones(len(laplace), np.complex128)
    for change in changes:
        core = change.left @ frequency_dependent_core(change, laplace) @ change.right.T
        factor = factor + core[:, 0, 0]
    return factor
