"""Gains that a campaign does not know: channels and drives in counts, volts or amperes."""

from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field


@dataclass(frozen=True)
class NominalGain:
    """Gain of a channel or of a force channel as it is known before any fit: H_measured = gain H.

    Args:
        location: ``sensor:<site>`` or ``hammer:<name>``.
        direction: direction of the channel, such as ``tx``; empty for a signal, which has one
            channel; None for a force channel.
        value: gain by which the FRFs of the campaign were divided.
        is_product: whether the data show the product with the gain of the force channel only.
        delay_s: of a drive or encoder, from which the FRFs were freed too [s].
    """

    location: str
    direction: str | None
    value: float
    is_product: bool = False
    delay_s: float = 0.0

    @property
    def parameter(self) -> str:
        """Name of the model's parameter that corrects it: the gain over its nominal value."""
        place = self.location.partition(":")[2]
        if self.direction is None:
            return f"hammer({place}).gain"
        if not self.direction:
            return f"{place}.gain"
        axis = self.direction[1:] if self.direction[0] == "t" else self.direction
        return f"{place}.gain_{axis}"

    @property
    def delay_parameter(self) -> str:
        """Name of the parameter that corrects the delay of a drive or signal; else empty."""
        place = self.location.partition(":")[2]
        if self.direction is None:
            return f"hammer({place}).delay"
        return "" if self.direction else f"{place}.delay"

    @property
    def label(self) -> str:
        """Place and direction in words, such as ``acc3 tx`` or ``hammer default``."""
        kind, _, place = self.location.partition(":")
        return f"{kind} {place}" if self.direction is None else f"{place} {self.direction}".strip()


@dataclass(frozen=True)
class UnknownGains:
    """Sensors and force channels whose gains a campaign calls unknown.

    Args:
        sensors: names of the sites.
        hammers: names of hammers and drives.
        nominal: gains by which the FRFs were divided; empty before they were estimated.
    """

    sensors: AbstractSet[str] = field(default_factory=frozenset)
    hammers: AbstractSet[str] = field(default_factory=frozenset)
    nominal: tuple[NominalGain, ...] = ()

    def __bool__(self) -> bool:
        """Return whether any gain is unknown."""
        return bool(self.sensors or self.hammers)
