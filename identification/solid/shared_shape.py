"""Free shape beside the rigid motions: its direction, and the gain of a free amplitude along it.

Let S_b = sum P z z^H P over block b, with the noise on its diagonal subtracted. It holds what is
neither rigid motion nor noise. A flexible mode gives it one direction u in all blocks, with any
amplitude. Let u^T S_b u = n_b m_b, and let the amplitude be CN(0, t_b). At the best t_b >= 0 the
log likelihood rises by n_b (m_b - 1 - log m_b) where m_b > 1. Half the logarithm of n_b is
subtracted for the fit of t_b (Laplace approximation). Weights hold the model-error floor beside the
noise, so m_b is one more than the residual beyond noise over n_b.

Fits of one body with free shapes, each made once however many hypotheses ask for it.
"""

from dataclasses import dataclass, replace

import numpy as np

from identification.solid.moments import Moments
from identification.solid.rigid_fit import FittedErrors, RigidFitModel, fit_errors
from identification.solid.sensor_faults import BelievedBody, FaultHypothesis
from identification.solid.slope_products import project
from identification.words import Mask, Real

_N_ALTERNATIONS = 3  # alternations of the fit of errors and of the shape
# Cosine above which two directions in the redundant channels are equal, and the number of sensors
# from which on a direction is shared.
_MIN_DIRECTION_COSINE, _MIN_SHARING_SENSORS = 0.99, 3
_MIN_CHANNEL_RESPONSE = 1e-3  # residual part of a channel's unit vector that counts
_NORMAL_QUARTILE = 0.674  # quartile of a normal distribution, in standard deviations


@dataclass(frozen=True, eq=False)
class FreeShape:
    """A fit with one additional free shape.

    Args:
        model: model with the shape among its extra ones.
        fitted: errors, fitted with the shape projected out.
        shape: readings per amplitude, of length one in units of the noise; (n_channel,).
        price: cost of the choice among all possible shapes [nats].
    """

    model: RigidFitModel
    fitted: FittedErrors
    shape: Real
    price: float = 0.0


def common_shape(model: RigidFitModel, moments: Moments, errors: Real, steps: int) -> FreeShape:
    """Fit errors and the leading shape of the residual in turn, starting from these errors."""
    total = moments.sum_blocks(slice(None))
    for _ in range(_N_ALTERNATIONS):
        shape = leading_shape(model, moments, errors)
        wider = replace(model, extra=np.column_stack([model.extra, shape]))
        fitted = fit_errors(wider, total, start=errors, steps=steps)
        errors = fitted.errors
    return FreeShape(wider, fitted, shape)


def channel_shape(
    model: RigidFitModel, moments: Moments, channel: int, errors: Real, steps: int
) -> FreeShape:
    """Fit errors, starting from these, with the readings of one channel left free."""
    shape = np.zeros(len(model.scale))
    shape[channel] = 1.0
    wider = replace(model, extra=np.column_stack([model.extra, shape]))
    fitted = fit_errors(wider, moments.sum_blocks(slice(None)), start=errors, steps=steps)
    return FreeShape(wider, fitted, shape)


def shared_channels(model: RigidFitModel, mask: Mask, errors: Real) -> list[int]:
    """Return the channels whose residual direction channels of at least three sensors share.

    Sensors at the corners of a plate have one redundant channel of height. Every bending out of the
    plane shows there, and so does an error of each of these sensors.
    """
    rows = model.rows(errors) * model.scale[:, None]
    projected = project(rows, mask).residual_projector * mask
    length = np.linalg.norm(projected, axis=0)
    projected = projected / np.where(length > _MIN_CHANNEL_RESPONSE, length, np.inf)
    is_parallel = np.abs(projected.T @ projected) > _MIN_DIRECTION_COSINE
    sensors = model.sensors.sensor_of
    return [
        k
        for k, is_shared in enumerate(is_parallel)
        if len(set(sensors[is_shared].tolist())) >= _MIN_SHARING_SENSORS
    ]


def leading_shape(model: RigidFitModel, moments: Moments, errors: Real) -> Real:
    """Return the direction of most residual beyond noise in the largest group; (n_channel,)."""
    group = int(np.argmax(moments.count.sum(axis=1)))
    moments = moments.without_delays(model.sensors.delays(errors))
    rows = model.rows(errors) * model.scale[:, None]
    projector = project(rows, moments.mask[group]).residual_projector
    clean = moments.gram[group].sum(axis=0) - np.diag(moments.noise[group].sum(axis=0))
    _, vectors = np.linalg.eigh(projector @ clean @ projector)
    return vectors[:, -1] / model.scale


def amplitude_gain(
    model: RigidFitModel, moments: Moments, errors: Real, shape: Real, noise_scale: float
) -> tuple[float, Real]:
    """Compute the gain in log likelihood of a free amplitude along a shape [nats].

    Args:
        model: model without the shape.
        moments: sums of the data, per block.
        errors: errors of the sensors; (n_error,).
        shape: readings per amplitude; (n_channel,).
        noise_scale: variance of the noise over the stated one.

    Returns:
        The gain, and the power of the amplitude per block beyond noise [noise]; (n_block,).
    """
    moments = moments.without_delays(model.sensors.delays(errors))
    gain, power = 0.0, np.zeros(moments.gram.shape[1])
    for mask, gram, noise, count in zip(
        moments.mask, moments.gram, moments.noise, moments.count, strict=True
    ):
        scale = model.scale * mask
        projector = project(model.rows(errors) * scale[:, None], mask).residual_projector
        direction = projector @ (shape * scale)
        length = np.linalg.norm(direction)
        if length <= 1e-6 * np.linalg.norm(shape * scale):
            continue
        direction = direction / length
        measured = np.einsum("c,bcd,d->b", direction, gram, direction)
        expected = noise_scale * noise @ direction**2
        excess = np.maximum(measured - expected, 0.0) / (noise_scale * np.maximum(count, 1))
        rise = count * (excess - np.log1p(excess)) - 0.5 * np.log(np.maximum(count, 1))
        gain += float(np.maximum(rise, 0.0).sum())
        power += np.maximum(measured - expected, 0.0)
    return gain, power


def estimate_noise_scale(
    model: RigidFitModel, moments: Moments, errors: Real, highest: float
) -> float:
    """Estimate the variance of the noise over the stated one, from the quietest blocks.

    It is the lower quartile over blocks of residual over expected noise. The expected difference of
    that quartile from the mean is corrected, and the result is kept between 1 and ``highest``. A
    body that is solid in a quarter of the band thus shows how well its noise is stated.
    """
    residual, expected = block_residuals(model, moments, errors)
    known = expected > 0
    if not known.any():
        return 1.0
    quartile = np.quantile(residual[known] / expected[known], 0.25)
    below = _NORMAL_QUARTILE / np.sqrt(np.median(expected[known]))
    return float(np.clip(quartile / (1 - min(below, 0.5)), 1.0, highest))


def block_residuals(model: RigidFitModel, moments: Moments, errors: Real) -> tuple[Real, Real]:
    """Compute the residual, and the residual that noise alone would give, per block; (n_block,)."""
    moments = moments.without_delays(model.sensors.delays(errors))
    residual = np.zeros(moments.gram.shape[1])
    expected = np.zeros_like(residual)
    for mask, gram, noise in zip(moments.mask, moments.gram, moments.noise, strict=True):
        projector = project(model.rows(errors) * model.scale[:, None], mask).residual_projector
        residual += np.einsum("cd,bcd->b", projector, gram)
        expected += noise @ np.diag(projector)
    return residual, expected


def folds(blocks: int) -> tuple[Mask, Mask]:
    """Return two folds of blocks for cross-validation: those with even and with odd numbers."""
    even = np.arange(blocks) % 2 == 0
    return even, ~even


_NATS_PER_SHAPE_DIRECTION = 2.0  # cost of each direction that a free shape may take [nats]
# Cost of the direction that several sensors share [nats]: log 2, since half of all plates bend
# that way.
_NATS_OF_SHARED_SHAPE = 0.7


class FreeShapes:
    """Fits of a body with free shapes from one start.

    A channel that is left free is a shape too: its fit serves the hypothesis that its readings are
    unknown, and the search for the shape of a flexible body.

    Args:
        state: the believed body.
        moments: sums of its data.
        start: errors at the start; (n_error,).
        steps: Gauss-Newton steps of each fit, at most.
    """

    def __init__(self, state: BelievedBody, moments: Moments, start: Real, steps: int) -> None:
        self._state, self._moments, self._start, self._steps = state, moments, start, steps
        self._channels: dict[int, FreeShape] = {}

    def fit(self, hypothesis: FaultHypothesis) -> list[FreeShape]:
        """Fit the shape of one channel, or common shapes of all, with errors fitted beside them."""
        if hypothesis.effect != "flexible_body":
            return [self._channel(hypothesis.channels[0])]
        return self._common()

    def _channel(self, channel: int) -> FreeShape:
        """Return the fit with the readings of one channel left free."""
        if channel not in self._channels:
            self._channels[channel] = channel_shape(
                self._state.model, self._moments, channel, self._start, self._steps
            )
        return self._channels[channel]

    def _common(self) -> list[FreeShape]:
        """Fit common shapes of all channels.

        Where errors of sensors have absorbed a part of the shape, a fit of both does not return
        from there. So the common shape is fitted from the end of the fit without it, and from that
        of the best single channel, too. A direction that channels of several sensors share has a
        smaller prior cost, since it need not be found among all redundant ones.
        """
        model, moments, start, steps = self._state.model, self._moments, self._start, self._steps
        mask = moments.mask[0]
        single_channels = [self._channel(channel) for channel in range(len(model.scale))]
        best = min(single_channels, key=lambda shape: shape.fitted.data)
        healthy = fit_errors(model, moments.sum_blocks(slice(None)), start=start, steps=steps)
        redundant = int(mask.sum()) - project(model.rows(start) * model.scale[:, None], mask).rank
        price = _NATS_PER_SHAPE_DIRECTION * max(redundant - 1, 0)
        shapes = [
            replace(common_shape(model, moments, errors, steps), price=price)
            for errors in (start, healthy.errors, best.fitted.errors)
        ]
        shared = shared_channels(model, mask, start)
        return shapes + [replace(single_channels[k], price=_NATS_OF_SHARED_SHAPE) for k in shared]
