"""Part of a channel that is no direction of a sensor: its gain and its delay.

It reads y_measured = gain exp(-s delay) y, for an encoder, a MuJoCo sensor, the difference of two
points, or a motion at a body or point without sensor.

Part for the force channel or drive: one gain and one delay for all tests that it drove.

A test reads H_measured = gain exp(-s delay) H in all its channels, whatever the place of the hit. A
force channel that lags the motion is a negative delay. With several Parts of this kind in one
test, their factors multiply.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.words import DIRECTIONS, Complex, Condition, Dof, Output, Real
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


@dataclass(frozen=True, eq=False)
class HammerGainPart:
    """Gain and delay of one hammer or drive, or the gain of its hits at one reference.

    Args:
        instrument: name of the hammer or drive, as ``Condition.instrument`` gives it.
        known: kind of the gain's prior.
        reference: direction of a point that it hits; None for all that it drives.
    """

    instrument: str
    known: ToleranceKind
    reference: Dof | None = None

    @property
    def location(self) -> str:
        """Place in the test, ``hammer:<name>``."""
        return f"hammer:{self.instrument}"

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The gain and the delay; the gain alone at one reference."""
        if self.reference is not None:
            name = f"hammer({self.reference.point}:{self.reference.direction[1:]})"
            return (Parameter(f"{name}.gain", 1.0, "1", known=self.known),)
        name = f"hammer({self.instrument})"
        return (
            Parameter(f"{name}.gain", 1.0, "1", known=self.known),
            Parameter(f"{name}.delay", 0.0, "s", positive=False, known="hammer_delay"),
        )

    def acts(self, condition: Condition | None) -> float:
        """Return 1 in the tests that this hammer or drive made, at its reference, else 0."""
        if condition is None or condition.instrument != self.instrument:
            return 0.0
        return float(self.reference in (None, condition.reference.positive))

    def changes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return gain exp(-s delay) - 1, if this hammer made the test."""
        gain, delay = self._read(theta)
        if not self.acts(context.condition) or (gain == 1 and delay == 0):
            return ()
        if delay == 0:
            return (_factor(np.array([gain - 1.0, 0.0, 0.0]), 0.0),)
        return (
            _factor(np.array([gain, 0.0, 0.0]), delay),
            _factor(np.array([-1.0, 0.0, 0.0]), 0.0),
        )

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return exp(-s delay) and -s gain exp(-s delay), if this hammer made the test."""
        gain, delay = self._read(theta)
        if not self.acts(context.condition):
            return ()
        slopes = np.array([[1.0, 0.0, 0.0], [0.0, -gain, 0.0]])
        return (_factor(slopes[: len(self.parameters)], delay),)

    def _read(self, theta: Real) -> tuple[float, float]:
        """Return gain and delay."""
        return float(theta[0]), float(theta[1]) if len(theta) > 1 else 0.0

    def write(self, theta: Real) -> tuple[Edit | NotInMjcf, ...]:
        """Return that an MJCF holds neither gain nor delay."""
        return tuple(
            NotInMjcf(parameter.name, MjcfLack.FORCE_CHANNEL)
            for parameter, value in zip(self.parameters, theta, strict=True)
            if value != parameter.drawn
        )

    def select_held(self, theta: Real) -> Real:
        """Return the nominal values."""
        return drawn_values(self, theta)


def _factor(coefficients: Real, delay: float) -> Change:
    """Return a polynomial in s times exp(-s delay) in the inputs' factor."""
    unit, core = np.ones((1, 1)), coefficients[..., None, None]
    if delay == 0:
        return Change("input", unit, unit, core)

    def delay_factor(laplace: Complex) -> Complex:
        return np.exp(-laplace * delay)

    return Change("input", unit, unit, core, shape=delay_factor)


def hammer_gain_parts(
    instruments: Iterable[str], known: ToleranceKind
) -> tuple[HammerGainPart, ...]:
    """Return one Part for each hammer or drive.

    Args:
        instruments: names of hammers and drives.
        known: kind of the gains' prior.
    """
    return tuple(HammerGainPart(instrument, known) for instrument in instruments)
