"""Findings of the reciprocity check: gains, delays, signs, exchanges; sentences and faults."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtr

from identification.solid.body_check import Fault
from identification.words import Campaign, Dof, Tolerance

BLOCKS = 12  # of lines, for the jackknife
_MAX_FALSE_ALARMS = 1e-3  # a campaign, over all ratios


@dataclass(frozen=True)
class ChannelRatio:
    """Factor k of one reference over the median of all, or over the first of two.

    Args:
        reference: where the force acts.
        channel: what reads the motion along it: a label, or the sensors of a body.
        gain: of the channel over that of the hits; negative for a sign.
        gain_sd: its standard deviation.
        delay: of the channel after the force [s].
        delay_sd: its standard deviation [s].
    """

    reference: str
    channel: str
    gain: float
    gain_sd: float
    delay: float
    delay_sd: float

    def sizes(self, tolerance: Tolerance) -> dict[str, tuple[float, float]]:
        """Return the size of gain and delay, each with the probability that it is no chance.

        Chance is the scatter of the estimate, and the tolerances of channels and hits, but at least
        those that are usual: a drift between hits gives smaller ones. The jackknife has few blocks,
        so that the sum has Welch's number of degrees of freedom.
        """
        gain = abs(self.gain)
        usual_gain, usual_delay = (
            max(np.hypot(*stated), np.hypot(*usual)) for stated, usual in _tolerances(tolerance)
        )
        return {
            "gain": (gain, _probability(np.log(gain), self.gain_sd / gain, usual_gain)),
            "delay": (self.delay, _probability(self.delay, self.delay_sd, usual_delay)),
        }


def _tolerances(tolerance: Tolerance) -> Iterator[tuple[tuple[float, float], tuple[float, float]]]:
    """Yield tolerances of gains and of delays, each of channel and hammer, stated and usual."""
    for name in ("gain", "delay"):
        stated, usual = (
            (getattr(each, f"sensor_{name}"), getattr(each, f"hammer_{name}"))
            for each in (tolerance, Tolerance())
        )
        yield stated, usual


def _probability(size: float, deviation: float, usual: float) -> float:
    """Return the probability that a size is no chance of its estimate and of what is usual."""
    total = float(np.hypot(deviation, usual))
    if total == 0:
        return 0.0
    freedom = (BLOCKS - 1) * (total / max(deviation, 1e-3 * total)) ** 4
    return float(1 - 2 * stdtr(freedom, -abs(size) / total))


@dataclass(frozen=True)
class Reciprocity:
    """Result of the reciprocity check of a campaign.

    Args:
        rows: one for each reference.
        error: what breaks reciprocity beside them, over the motion of the drive points.
        excess: what they leave, over the noise.
        exchanged: numbers of two references whose channels, or hits, are exchanged; or none.
        doubt: why it is a hint alone, such as a rotor; empty if it holds.
        may_tilt: whether hits in several directions at one point may feign gains and delays.
    """

    rows: tuple[ChannelRatio, ...]
    error: float
    excess: float
    exchanged: tuple[int, ...] = ()
    doubt: str = ""
    may_tilt: bool = False

    def remarks(self, tolerance: Tolerance) -> list[str]:
        """Say which channels or hits are exchanged, reversed, or beyond their tolerances.

        Args:
            tolerance: of gains and delays of channels and hits.
        """
        because = f" (a hint, since {self.doubt})" if self.doubt else ""
        return [f"by reciprocity{because}, {sentence}" for sentence in self._sentences(tolerance)]

    def _sentences(self, tolerance: Tolerance) -> Iterator[str]:
        """Yield what follows 'by reciprocity'."""
        if self.exchanged:
            names = " and ".join(self.rows[number].channel for number in self.exchanged)
            yield f"{names} are exchanged, or the hits there: check the labels; nothing was changed"
        for row in self.rows:
            place = f"{row.channel} or the hits at {row.reference}"
            if len(self.rows) == 2:
                place += f", or those at {self.rows[0].reference},"
            if row.gain < 0:
                yield f"{place} have the opposite sign: check directions; no sign was changed"
            sizes = self._proven(row, tolerance)
            if "gain" in sizes:
                yield (
                    f"{place} have another gain: motion over force is {abs(row.gain):.4g} "
                    f"(sd {row.gain_sd:.2g}) times that of the others: check both calibrations"
                )
            if "delay" in sizes:
                yield (
                    f"{place} have another delay: motion is {1e3 * abs(row.delay):.3g} ms "
                    f"(sd {1e3 * row.delay_sd:.2g}) {'later' if row.delay > 0 else 'earlier'} "
                    "after force than elsewhere: check filters and couplings of both channels"
                )

    def _proven(self, row: ChannelRatio, tolerance: Tolerance) -> dict[str, tuple[float, float]]:
        """Return the sizes that are no chance, with their probabilities."""
        if self.may_tilt:
            return {}
        chance = _MAX_FALSE_ALARMS / (2 * (len(self.rows) - 1))
        sizes = row.sizes(tolerance)
        return {name: size for name, size in sizes.items() if 1 - size[1] < chance}

    def _exchanged_place(self, campaign: Campaign) -> tuple[str, str | None] | None:
        """Return location and directions of an exchange: of one sensor, or of two whole ones."""
        labels = [self.rows[number].channel for number in self.exchanged]
        if not labels or not all(":" in label for label in labels):
            return None
        first, second = (Dof.parse(label) for label in labels)
        axes = first.direction[1:], second.direction[1:]
        if first.point == second.point:
            return f"sensor:{first.point}", "+".join(axes)
        channels = [dof for dof in campaign.outputs if dof.point in (first.point, second.point)]
        if len(channels) > len(labels) or axes[0] != axes[1]:
            return None  # of two sensors only some channels are exchanged
        return f"sensor:{first.point}+{second.point}", None

    def faults(self, campaign: Campaign) -> list[Fault]:
        """Return the faults of sensors that compete with all others in a diagnosis.

        A ratio is that of the channel, or of the hits at its reference: their gain is 1 / k, their
        delay that of k with the other sign (``of_hits``). Only a model tells both apart.

        Args:
            campaign: its tests state hammers, its tolerances what is no fault.
        """
        hammers = {test.condition.instrument for test in campaign.tests}
        if self.doubt or len(hammers) > 1 or len(self.rows) < 3:
            return []
        faults = []
        if place := self._exchanged_place(campaign):
            faults.append(Fault("sensor_swap", *place, 1.0, {}, self.excess))
        for row in self.rows:
            if ":" not in row.channel:  # the sensors of a body
                continue
            channel, hit = Dof.parse(row.channel), Dof.parse(row.reference)
            place = f"sensor:{channel.point}", channel.direction[1:]
            of_hits = f"hammer:{hit.point}", hit.direction[1:]
            proven = self._proven(row, campaign.tolerance)
            named = [("polarity", -1.0, 1.0)] if row.gain < 0 else []
            for name, size, probability in (*named, *((k, *size) for k, size in proven.items())):
                kind, of_hit = ("delay", -size) if name == "delay" else ("gain", 1 / size)
                hits = Fault(f"hammer_{kind}", *of_hits, probability, {kind: of_hit}, self.excess)
                sizes: dict[str, float | tuple[float, ...]] = (
                    {} if name == "polarity" else {name: size}
                )
                faults.append(
                    Fault(f"sensor_{name}", *place, probability, sizes, self.excess, hits)
                )
        return faults
