"""Weights of measured values in a misfit."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.words import Complex, Layout, Mask, Output, Real
from tuning.misfit.batch import Batch
from tuning.misfit.reduction import BodyWeight, body_weights

_MIN_MOTION_RATIO = 1e-10  # of the largest channel: below it a channel does not move
_MIN_POWER_RATIO = 25.0  # of |H|^2 to its variance: the logarithm of noisier values is biased
# Least relative error of any line: the force sensor's linearity and noise.
FORCE_ERROR_FLOOR = 3e-4


@dataclass(frozen=True, eq=False)
class WeightedBatch:
    """A batch of tests with its weights.

    Args:
        batch: measured values.
        log_size: log |H_measured|, zero where that is zero; (n_freq, n_out, n_test).
        weight: w of each value, zero where it does not count; (n_freq, n_out, n_test).
        body_weights: M of each body if residuals count at the centres of mass, else None.
    """

    batch: Batch
    log_size: Real
    weight: Real
    body_weights: tuple[BodyWeight, ...] | None = None

    @property
    def values(self) -> int:
        """Number of values that count."""
        if self.body_weights is None:
            return int((self.weight > 0).sum())
        return sum(body.values for body in self.body_weights)


def weight_batch(
    batch: Batch, model_error_floor: float, logarithmic: bool, counted: Mask
) -> WeightedBatch:
    """Weight the values of a batch by their variance and the model-error floor.

    Args:
        batch: measured values.
        model_error_floor: a, relative to the motion of each point.
        logarithmic: whether the residual is a logarithm; values near the noise and channels that do
            not move have no weight then.
        counted: whether each line counts; (n_freq,).
    """
    size = np.abs(batch.values)
    is_static = batch.evaluator.request.factor == 0  # 0 Hz, where the model's accelerance is zero
    is_live = (size > 0).any(axis=0)  # a silent channel is dead: its FRF is not exactly zero
    counts = batch.measured & is_live & ~is_static[:, None, None]
    if logarithmic:
        counts = counts & (size**2 > _MIN_POWER_RATIO * batch.variance) & _is_moving(batch)
    point_power = point_power_of(batch.values, batch.evaluator.request.outputs)
    total_variance = batch.variance + max(model_error_floor, FORCE_ERROR_FLOOR) ** 2 * point_power
    counts = counts & (total_variance > 0) & counted[:, None, None]
    weight = np.where(counts, 1.0 / np.where(counts, total_variance, 1.0), 0.0)
    return WeightedBatch(batch, np.log(np.where(size > 0, size, 1.0)), weight)


def weight_at_bodies(term: WeightedBatch, layout: Layout) -> WeightedBatch:
    """Weight a batch at the centres of mass.

    Channels of a body whose motion they do not determine have no weight.

    Args:
        term: batch with a weight for each channel.
        layout: bodies and points.
    """
    counts = term.weight > 0
    variance = 1 / np.where(counts, term.weight, 1.0)
    outputs = term.batch.evaluator.request.outputs
    return replace(term, body_weights=body_weights(layout, outputs, variance, counts))


def _is_moving(batch: Batch) -> Mask:
    """Return whether each channel moves in the nominal model; (n_out, n_test).

    A channel that does not move has no logarithm. Whether it moves depends on the geometry, not on
    stiffness or damping. A measured motion along a rigid direction shows in the gap, but no
    parameter that is tuned here can produce it.
    """
    evaluator = batch.evaluator
    largest = np.abs(batch.select_inputs(evaluator.at(evaluator.model.drawn).values)).max(axis=0)
    is_moving: Mask = largest > _MIN_MOTION_RATIO * largest.max(initial=0.0)
    return is_moving


def point_power_of(values: Complex, outputs: Sequence[Output]) -> Real:
    """Return |H_point|^2 of each channel: the sum over the directions of its kind at its point.

    Args:
        values: FRFs; (n_freq, n_out, n_test).
        outputs: labels of the channels; n_out.
    """
    places = [(dof.point, dof.is_rotation) for dof in outputs]
    at_point = np.array([[here == there for there in places] for here in places], float)
    power: Real = at_point @ np.abs(values) ** 2
    return power
