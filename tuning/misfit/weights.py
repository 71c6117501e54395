"""Weights of measured values in a misfit."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.words import Complex, Layout, Mask, Output, Real
from tuning.misfit.batch import MODAL_FORM_ERROR, Batch
from tuning.misfit.reduction import BodyWeight, body_weights

_MIN_POWER_RATIO = 25.0  # of |H|^2 to its variance: the logarithm of noisier values is biased
# Least relative error of any line: the force sensor's linearity and noise.
FORCE_ERROR_FLOOR = 3e-4


@dataclass(frozen=True, eq=False)
class WeightedBatch:
    """A batch of tests with its weights.

    Args:
        batch: measured values.
        log_size: log |H_measured|, zero where that is zero, for residuals that are logarithms,
            else None; (n_freq, n_out, n_test).
        weight: w of each value, zero where it does not count; (n_freq, n_out, n_test).
        body_weights: M of each body if residuals count at the centres of mass, else None.
    """

    batch: Batch
    log_size: Real | None
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

    All arrays run along frequency in memory, as those of a batch do.

    Args:
        model_error_floor: a, relative to the motion of each point.
        logarithmic: whether the residual is a logarithm; values near the noise and channels that do
            not move have no weight then.
        counted: whether each line counts; (n_freq,).
    """
    key = model_error_floor, counted.tobytes()
    if not logarithmic and key in batch.kept_weights:
        return WeightedBatch(batch, None, batch.kept_weights[key])
    variance, square = (
        array.transpose(1, 2, 0) for array in (batch.variance, squared_size(batch.values))
    )
    is_static = batch.evaluator.request.factor == 0  # 0 Hz, where the model's accelerance is zero
    is_live = (square > 0).any(axis=2)  # a silent channel is dead: its FRF is not exactly zero
    counts = (batch.measured & is_live)[:, :, None] & (counted & ~is_static)
    log_size = None
    if logarithmic:
        counts &= (square > _MIN_POWER_RATIO * variance) & _is_moving(batch)[:, :, None]
        log_size = 0.5 * np.log(np.where(square > 0, square, 1.0)).transpose(2, 0, 1)
    point_power = point_power_of(batch.values, batch.evaluator.request.outputs).transpose(1, 2, 0)
    total_variance = variance + max(model_error_floor, FORCE_ERROR_FLOOR) ** 2 * point_power
    counts &= total_variance > 0
    weight = np.divide(1.0, total_variance, out=np.zeros(counts.shape), where=counts)
    if not logarithmic:
        batch.kept_weights[key] = weight.transpose(2, 0, 1)
    return WeightedBatch(batch, log_size, weight.transpose(2, 0, 1))


def weight_at_bodies(term: WeightedBatch, layout: Layout) -> WeightedBatch:
    """Weight a batch at the centres of mass.

    Channels of a body whose motion they do not determine have no weight.

    Args:
        term: batch with a weight for each channel.
    """
    counts = term.weight > 0
    variance = 1 / np.where(counts, term.weight, 1.0)
    outputs = term.batch.evaluator.request.outputs
    return replace(term, body_weights=body_weights(layout, outputs, variance, counts))


def _is_moving(batch: Batch) -> Mask:
    """Return whether each channel moves in the nominal model; (n_out, n_test).

    A channel that does not move, beyond what the modal form leaves of zero, has no logarithm: on a
    symmetric machine that would be a large residual or none, by chance. Whether it moves depends on
    the geometry, not on stiffness or damping. A measured motion along a rigid direction shows in
    the gap, but no parameter that is tuned here can produce it.
    """
    evaluator = batch.evaluator
    largest = np.abs(batch.select_inputs(evaluator.at(evaluator.model.drawn).values)).max(axis=0)
    return largest > MODAL_FORM_ERROR * largest.max(initial=0.0)


def point_power_of(values: Complex, outputs: Sequence[Output]) -> Real:
    """Return |H_point|^2 of each channel: the sum over the directions of its kind at its point.

    Args:
        values: FRFs; (n_freq, n_out, n_test).
        outputs: labels of the channels; n_out.

    Returns:
        In memory along frequency; (n_freq, n_out, n_test).
    """
    numbers: dict[tuple[str, bool], int] = {}
    point_of = [numbers.setdefault((dof.point, dof.is_rotation), len(numbers)) for dof in outputs]
    at_point = (np.arange(len(numbers))[:, None] == point_of).astype(float)
    square = squared_size(values.transpose(1, 2, 0))
    power = (at_point @ square.reshape(len(square), -1))[point_of]
    return power.reshape(square.shape).transpose(2, 0, 1)


def squared_size(values: Complex) -> Real:
    """Return |z|^2 of complex values, without the square root of their size."""
    return values.real**2 + values.imag**2
