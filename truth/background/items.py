"""Imperfections that no effect of the catalogue has: delays of single channels, guides askew."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from truth.effects.effect import Answer, Sized
from truth.effects.sensors import outputs
from truth.machine.rig import Filter, Occasion, Prepared, Rig
from truth.machine.station import Complex, Joint

LIMITS = (1e-9, 1e3)


@dataclass(frozen=True)
class ChannelDelays(Sized):
    """Each of the three channels of a sensor comes late by a delay of its own.

    A reading is multiplied by exp(-s tau).

    Args:
        size: longest delay [s].
        node: number of the sensor.
        shares: tau of each channel over the longest; (3,).
    """

    node: int
    shares: tuple[float, float, float]
    limits = LIMITS

    def answer(self) -> Answer:
        """Return the effect of the catalogue that is nearest, with the mean delay."""
        delay = self.size * float(np.mean(self.shares))
        return Answer("sensor_delay", f"sensor:acc{self.node}", parameters={"delay": delay})

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with a filter on each channel."""
        del occasion
        filters = tuple(
            Filter((row,), partial(_delay_response, share * self.size))
            for row, share in zip(outputs(tested.station, self.node), self.shares, strict=True)
        )
        return replace(rig, filters=(*rig.filters, *filters))


def _delay_response(delay: float, s: Complex) -> Complex:
    return np.asarray(np.exp(-s * delay))


@dataclass(frozen=True)
class AskewGuides(Sized):
    r"""The axes of a stage's joints are turned, each about a vector of its own.

    An axis a becomes a + size (v x a), of unit length again: the spring acts along another line, so
    that the directions of the joint are coupled.

    Args:
        size: standard deviation of the turns [rad].
        stage: name of the child body.
        turns: v of each joint; (n_joint, 3).
    """

    stage: str
    turns: tuple[tuple[float, float, float], ...]
    limits = LIMITS

    def answer(self) -> Answer:
        """Return the effect of the catalogue that is nearest: a coupling of the joint."""
        return Answer("joint_coupling", f"joint:{self.stage}")

    def to_machine(self, tested: Prepared, occasion: Occasion) -> Prepared:
        """Return the machine with the axes turned."""
        del occasion
        index = tested.station.index(self.stage)
        stages = list(tested.station.stages)
        joints = tuple(
            self._turn_joint(joint, turn)
            for joint, turn in zip(stages[index].joints, self.turns, strict=True)
        )
        stages[index] = replace(stages[index], joints=joints)
        return replace(tested, station=replace(tested.station, stages=tuple(stages)))

    def _turn_joint(self, joint: Joint, turn: tuple[float, float, float]) -> Joint:
        return replace(joint, axis=joint.axis + self.size * np.cross(turn, joint.axis))
