r"""The residual that tuning minimises: the logarithm of the complex ratio of model to measurement.

    r = log(H_model / H_measured) = log of the magnitude's ratio + i times the phase's difference
    J = 1 / (2 N) sum |r|^2 |H_measured|^2 / (var + a^2 |H_point|^2)

N is the number of values, var the variance of the measured value and a the allowance: an error
that the model may have anyway, relative to |H_point|, the length of the measured vector of all
directions at the same point of the same test. A sensor that is one degree off reads 1.7 % of the
motion along its other axes, however little moves along its own. A large allowance at first makes
all lines count alike, resonances and valleys; a small one last leaves the noise to weigh them. Of
the residuals tried (plain complex, magnitude in decibels, this one) only this one found the same
minimum from every start.
"""

from dataclasses import dataclass

import numpy as np

from identification.words import Campaign, Complex, Mask, Real
from mbmodel import Model
from tuning.batch import Batch, batches

_STILL = 1e-10


@dataclass(frozen=True, eq=False)
class _Weighted:
    batch: Batch
    log_size: Real
    conjugate: Complex
    weight: Real
    partial: bool


class LogCost:
    """The cost J over a campaign as a function of theta, with its exact gradient.

    Args:
        model: machine and Parts.
        campaign: its lines are those that count.
        allowance: a, relative to the motion of each point.
    """

    def __init__(self, model: Model, campaign: Campaign, allowance: float) -> None:
        self._terms = [_weigh(batch, allowance) for batch in batches(model, campaign)]
        count = sum(int((term.weight > 0).sum()) for term in self._terms)
        self._scale = 1.0 / max(count, 1)

    def __call__(self, theta: Real) -> tuple[float, Real]:
        """J and dJ / dtheta in SI; (n_parameter,)."""
        total, gradient = 0.0, np.zeros(len(theta))
        for term in self._terms:
            linearised = term.batch.evaluator.at(theta)
            model = term.batch.pick(linearised.values)
            if term.partial:
                model = np.where(term.weight > 0, model, term.conjugate.conj())
            size = 2 * np.log(np.abs(model)) - term.log_size
            product = model * term.conjugate
            residual = 0.5 * size + 1j * np.arctan2(product.imag, product.real)
            weighted = residual * (term.weight * self._scale)
            total += 0.5 * float(np.vdot(residual, weighted).real)
            # dr = dH / H, so dJ = Re sum conj(weighted) dH / H = Re sum conj(W) dH.
            cotangent = term.batch.spread(weighted / model.conj())
            gradient += linearised.gradient(cotangent)
        return total, gradient


def _weigh(batch: Batch, allowance: float) -> _Weighted:
    size = np.abs(batch.values)
    resting = batch.evaluator.question.factor == 0  # 0 Hz, where the model's accelerance is zero
    counts = batch.measured & (size > 0) & _moving(batch) & ~resting[:, None, None]
    known = np.where(counts, batch.values, 1.0)
    allowed = batch.variance + allowance**2 * _point_power(batch)
    weight = np.where(counts, size**2 / np.where(counts, allowed, 1.0), 0.0)
    return _Weighted(
        batch,
        log_size=2 * np.log(np.abs(known)),
        conjugate=known.conj(),
        weight=weight,
        partial=not weight.all(),
    )


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
