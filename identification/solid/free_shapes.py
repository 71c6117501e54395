"""Fits of one body with free shapes, each made once however many hypotheses ask for it."""

from dataclasses import replace

from identification.solid.moments import Moments
from identification.solid.projection import project
from identification.solid.rigid_fit import fit_errors
from identification.solid.sensor_faults import BelievedBody, FaultHypothesis
from identification.solid.shared_shape import (
    FreeShape,
    channel_shape,
    common_shape,
    shared_channels,
)
from identification.words import Real

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
