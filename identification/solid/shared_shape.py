r"""A shape that is no rigid motion: where it points, and what a free amplitude along it explains.

In the spare channels of a body S_b = sum P z z^H P over block b, noise on its diagonal taken off,
holds what is neither motion nor noise. A flexible mode gives it one direction u that all blocks
share, an amplitude as it comes. With u^T S_b u = n_b m_b and an amplitude CN(0, t_b), the
likelihood at the best t_b >= 0 rises by n_b (m_b - 1 - log m_b) where m_b > 1, less half the
logarithm of n_b for finding t_b (Gaussian; the logarithm is what the free amplitude costs).
Weights hold the floor beside the noise, so m_b is one more than the residual beyond noise over
n_b.
"""

from dataclasses import dataclass, replace

import numpy as np

from identification.solid.rigid_fit import Fitted, Model, Moments, fit, project
from identification.words import Mask, Real

_ROUNDS = 3
_SAME, _SHARED = 0.99, 3  # cosine of directions in the spare channels, sensors that share one
_UNSEEN = 1e-3  # of a channel, that its spare part must exceed
_QUARTILE = 0.674  # of a normal distribution, in standard deviations


@dataclass(frozen=True, eq=False)
class Shape:
    """A fit with one free shape more.

    Args:
        model: with the shape among its extra ones.
        fitted: the errors, the shape projected out.
        shape: readings per amplitude, of length one in units of the noise; (n_channel,).
        price: nats for finding it among all that it might be.
    """

    model: Model
    fitted: Fitted
    shape: Real
    price: float = 0.0


def common_shape(model: Model, moments: Moments, errors: Real, steps: int) -> Shape:
    """Fit errors and the leading shape of the residual in turn, from these errors."""
    total = moments.over(slice(None))
    for _ in range(_ROUNDS):
        shape = leading_shape(model, moments, errors)
        wider = replace(model, extra=np.column_stack([model.extra, shape]))
        fitted = fit(wider, total, start=errors, steps=steps)
        errors = fitted.errors
    return Shape(wider, fitted, shape)


def channel_shape(model: Model, moments: Moments, channel: int, errors: Real, steps: int) -> Shape:
    """Fit errors, from these, with one channel left to itself."""
    shape = np.zeros(len(model.scale))
    shape[channel] = 1.0
    wider = replace(model, extra=np.column_stack([model.extra, shape]))
    fitted = fit(wider, moments.over(slice(None)), start=errors, steps=steps)
    return Shape(wider, fitted, shape)


def shared_channels(model: Model, mask: Mask, errors: Real) -> list[int]:
    """Channels that three sensors' tell the same of: whatever one of them reads too much.

    Sensors at the corners of a plate have one spare channel of height: every bending out of the
    plane shows there, and so does each of them if it reads too much.
    """
    rows = model.rows(errors) * model.scale[:, None]
    seen = project(rows, mask).spare * mask
    length = np.linalg.norm(seen, axis=0)
    seen = seen / np.where(length > _UNSEEN, length, np.inf)
    same = np.abs(seen.T @ seen) > _SAME
    sensors = model.sensors.sensor_of
    return [k for k, own in enumerate(same) if len(set(sensors[own].tolist())) >= _SHARED]


def leading_shape(model: Model, moments: Moments, errors: Real) -> Real:
    """Direction of most residual beyond noise, of the group with most values; (n_channel,)."""
    group = int(np.argmax(moments.count.sum(axis=1)))
    rows = model.rows(errors) * model.scale[:, None]
    spare = project(rows, moments.mask[group]).spare
    clean = moments.gram[group].sum(axis=0) - np.diag(moments.noise[group].sum(axis=0))
    _, vectors = np.linalg.eigh(spare @ clean @ spare)
    shape: Real = vectors[:, -1] / model.scale
    return shape


def amplitude_gain(
    model: Model, moments: Moments, errors: Real, shape: Real, noise_scale: float
) -> tuple[float, Real]:
    """Nats that a free amplitude along a shape explains, beside the same data without it.

    Args:
        model: without the shape.
        moments: per block.
        errors: of the sensors.
        shape: readings per amplitude; (n_channel,).
        noise_scale: variance of the noise over the stated one.

    Returns:
        The gain, and the amplitude's power per block beyond noise [noise]; (n_block,).
    """
    gain, power = 0.0, np.zeros(moments.gram.shape[1])
    for mask, gram, noise, count in zip(
        moments.mask, moments.gram, moments.noise, moments.count, strict=True
    ):
        scale = model.scale * mask
        spare = project(model.rows(errors) * scale[:, None], mask).spare
        direction = spare @ (shape * scale)
        length = np.linalg.norm(direction)
        if length <= 1e-6 * np.linalg.norm(shape * scale):
            continue
        direction = direction / length
        seen = np.einsum("c,bcd,d->b", direction, gram, direction)
        expected = noise_scale * noise @ direction**2
        beyond = np.maximum(seen - expected, 0.0) / (noise_scale * np.maximum(count, 1))
        rise = count * (beyond - np.log1p(beyond)) - 0.5 * np.log(np.maximum(count, 1))
        gain += float(np.maximum(rise, 0.0).sum())
        power += np.maximum(seen - expected, 0.0)
    return gain, power


def noise_scale(model: Model, moments: Moments, errors: Real, highest: float) -> float:
    """Variance of the noise over the stated one, from the quietest quarter of the blocks.

    The lower quartile over blocks of residual over expected noise, less what a quartile of so many
    numbers is below their mean, kept between 1 and ``highest``: a body that is solid in a quarter
    of the band tells how well its noise is stated.
    """
    seen, expected = block_residuals(model, moments, errors)
    known = expected > 0
    if not known.any():
        return 1.0
    quartile = np.quantile(seen[known] / expected[known], 0.25)
    below = _QUARTILE / np.sqrt(np.median(expected[known]))
    return float(np.clip(quartile / (1 - min(below, 0.5)), 1.0, highest))


def block_residuals(model: Model, moments: Moments, errors: Real) -> tuple[Real, Real]:
    """Residual and what noise alone would give, per block; (n_block,)."""
    seen = np.zeros(moments.gram.shape[1])
    expected = np.zeros_like(seen)
    for mask, gram, noise in zip(moments.mask, moments.gram, moments.noise, strict=True):
        spare = project(model.rows(errors) * model.scale[:, None], mask).spare
        seen += np.einsum("cd,bcd->b", spare, gram)
        expected += noise @ np.diag(spare)
    return seen, expected


def folds(blocks: int) -> tuple[Mask, Mask]:
    """Every other block of lines."""
    even = np.arange(blocks) % 2 == 0
    return even, ~even
