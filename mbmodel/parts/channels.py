"""Part of a channel that is no direction of a sensor: its gain and its delay.

It reads y_measured = gain exp(-s delay) y, for an encoder, a MuJoCo sensor, the difference of two
points, or a motion at a body or point without sensor.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.words import DIRECTIONS, Dof, Output, Real
from mbmodel.mjcf.edit import Edit, MjcfLack, NotInMjcf
from mbmodel.parts.part import Change, Parameter, PartContext, ToleranceKind, drawn_values


@dataclass(frozen=True, eq=False)
class ChannelPart:
    """Gain and delay of one channel.

    Args:
        channel: the channel, with positive sign.
        known: kind of the gain's prior.
    """

    channel: Output
    known: ToleranceKind = "sensor_gain"

    @property
    def location(self) -> str:
        """Place in the test, ``sensor:<name>``."""
        return f"sensor:{self.channel.point}"

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The gain and the delay; a direction at a point has the names of a sensor's channel."""
        name, end = self.channel.point, ""
        if isinstance(self.channel, Dof):
            direction = DIRECTIONS[self.channel.axis]
            end = f"_{direction[1:] if direction[0] == 't' else direction}"
        return (
            Parameter(f"{name}.gain{end}", 1.0, "1", known=self.known),
            Parameter(f"{name}.delay{end}", 0.0, "s", positive=False, known="sensor_delay"),
        )

    def changes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the logarithm of gain exp(-s delay)."""
        del context
        gain, delay = theta
        return (self._change(np.array([np.log(gain), -delay, 0.0])),) if theta.any() else ()

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the derivatives of that logarithm."""
        del context
        return (self._change(np.array([[1.0 / theta[0], 0.0, 0.0], [0.0, -1.0, 0.0]])),)

    def _change(self, coefficients: Real) -> Change:
        """Return a polynomial in s in the logarithm of the channel's factor."""
        row = np.zeros((len(DIRECTIONS), 1))
        row[self.channel.axis] = 1.0
        core = coefficients[..., None, None]
        return Change("output", row, np.ones((1, 1)), core, self.channel.point)

    def write(self, theta: Real) -> tuple[Edit | NotInMjcf, ...]:
        """Return that an MJCF holds neither gain nor delay of a channel."""
        return tuple(
            NotInMjcf(parameter.name, MjcfLack.CHANNEL)
            for parameter, value in zip(self.parameters, theta, strict=True)
            if value != parameter.drawn
        )

    def select_held(self, theta: Real) -> Real:
        """Return the nominal values."""
        return drawn_values(self, theta)


def channel_parts(
    channels: Iterable[Output], known: ToleranceKind = "sensor_gain"
) -> tuple[ChannelPart, ...]:
    """Return one Part for each channel.

    Args:
        channels: channels that no sensor's Part describes.
        known: kind of the gains' prior.
    """
    return tuple(ChannelPart(channel.positive, known) for channel in channels)
