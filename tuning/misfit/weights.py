"""Which measured values count in a misfit, and with which weight."""

from dataclasses import dataclass, replace

import numpy as np

from identification.words import Layout, Mask, Real
from tuning.misfit.batch import Batch
from tuning.misfit.reduction import Mixing, mixings

_STILL = 1e-10
_AUDIBLE = 25.0  # times the variance: the logarithm of a value near the noise leads astray
# Linearity and noise of the force, relative to the motion of a point: no line is known better.
FLOOR = 3e-4


@dataclass(frozen=True, eq=False)
class Weighted:
    """One batch and its weights w (n_freq, n_out, n_test), or M of each body beside them."""

    batch: Batch
    log_size: Real
    weight: Real
    mixed: tuple[Mixing, ...] | None = None

    @property
    def values(self) -> int:
        """How many numbers count."""
        if self.mixed is None:
            return int((self.weight > 0).sum())
        return sum(one.values for one in self.mixed)


def weigh(batch: Batch, allowance: float, logarithmic: bool, counted: Mask) -> Weighted:
    """Weights of differences, or of their logarithm, one by one.

    Args:
        batch: what was measured.
        allowance: a, relative to the motion of each point.
        logarithmic: whether values near the noise, and those that rest, count no more.
        counted: lines that count; (n_freq,).
    """
    size = np.abs(batch.values)
    resting = batch.evaluator.question.factor == 0  # 0 Hz, where the model's accelerance is zero
    heard = (size > 0).any(axis=0)  # a silent channel is dead, not exactly zero
    counts = batch.measured & heard & ~resting[:, None, None]
    if logarithmic:
        counts = counts & (size**2 > _AUDIBLE * batch.variance) & _moving(batch)
    point = _point_power(batch)
    allowed = batch.variance + max(allowance, FLOOR) ** 2 * point
    counts = counts & (allowed > 0) & counted[:, None, None]
    weight = np.where(counts, 1.0 / np.where(counts, allowed, 1.0), 0.0)
    return Weighted(batch, np.log(np.where(size > 0, size, 1.0)), weight)


def at_centres(term: Weighted, layout: Layout) -> Weighted:
    """Weights at the centres of mass; channels whose body they do not determine count no more."""
    counts = term.weight > 0
    variance = 1 / np.where(counts, term.weight, 1.0)
    outputs = term.batch.evaluator.question.outputs
    return replace(term, mixed=mixings(layout, outputs, variance, counts))


def _moving(batch: Batch) -> Mask:
    """Channels that move in the model at all; a zero has no logarithm; (n_out, n_test).

    Which those are lies in the geometry, not in stiffness and damping: what a rigid direction
    lacks shows in the gap, but nothing that is tuned here can mend it.
    """
    evaluator = batch.evaluator
    answer = np.abs(batch.pick(evaluator.at(evaluator.model.drawn).values)).max(axis=0)
    moving: Mask = answer > _STILL * answer.max(initial=0.0)
    return moving


def _point_power(batch: Batch) -> Real:
    """|H_point|^2 for each channel: the sum over the directions of its kind at its point."""
    outputs = batch.evaluator.question.outputs
    places = [(dof.point, dof.is_rotation) for dof in outputs]
    same = np.array([[here == there for there in places] for here in places], float)
    power: Real = np.einsum("ij,fjt->fit", same, np.abs(batch.values) ** 2)
    return power
