"""Hammers that hit elsewhere than drawn, or whose force channel is wrong."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from truth.effects.effect import Answer, Scene, Sized, Vector
from truth.effects.places import choose, hammer_site, log_uniform, sign, unit_vector
from truth.effects.sensors import draw_at, filter_readings, list_hammers, list_hit_points, turn
from truth.machine.rig import Occasion, Prepared, Rig, respond_late
from truth.machine.station import AXES, Complex

TOO_MUCH, TOO_LITTLE = (0.06, 0.2), (0.06, 0.15)  # |gain - 1|, beyond the tolerance of 2 %
DELAY = (6e-5, 3e-4)  # s, beyond the tolerance of 20 microseconds
ANGLE = (0.07, 0.4)  # rad
OFFSET = (0.01, 0.04)  # m, beyond the tolerance of 3 mm


@dataclass(frozen=True)
class HammerGain(Sized):
    """All FRFs are ``1 + sign * size`` times what they should be: a wrong calibration value.

    One hammer hits everywhere.

    Args:
        size: |gain - 1|.
        site: first point that is hit.
        sign: +1 for FRFs that are too large, -1 for too small ones.
    """

    site: str
    sign: int
    limits = (0.005, 0.9)

    @property
    def gain(self) -> float:
        """Return the FRFs over what they should be."""
        return 1 + self.sign * self.size

    def answer(self) -> Answer:
        """Return what is to be found."""
        return Answer("hammer_gain", f"hammer:{self.site}", parameters={"gain": self.gain})

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the factor on all readings."""
        return filter_readings(rig, tuple(range(len(rig.readout))), partial(_factor, self.gain))


def _factor(gain: float, s: Complex) -> Complex:
    return np.full(s.shape, gain, np.complex128)


@dataclass(frozen=True)
class HammerDelay(Sized):
    """All FRFs times exp(-s tau), tau = ``sign * size``: another filter or amplifier.

    A force channel that lags has tau < 0.

    Args:
        size: |tau| [s].
        site: first point that is hit.
        sign: of tau.
    """

    site: str
    sign: int
    limits = (1e-6, 5e-3)

    def answer(self) -> Answer:
        """Return what is to be found."""
        parameters = {"delay": self.sign * self.size}
        return Answer("hammer_delay", f"hammer:{self.site}", parameters=parameters)

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the delay on all readings."""
        late = partial(respond_late, self.sign * self.size)
        return filter_readings(rig, tuple(range(len(rig.readout))), late)


@dataclass(frozen=True)
class HammerMisalignment(Vector):
    """All hits of one direction at one point are turned by a rotation vector, d becomes R d.

    The rotation is about an axis at right angles to the drawn direction: a turn about the
    direction itself is not felt.

    Args:
        size: angle [rad].
        node: that is hit.
        site: of the drawing, ``hit<node>`` or ``acc<node>``.
        axis: 0, 1, 2 for the drawn direction.
    """

    node: int
    site: str
    axis: int
    limits = (1e-3, 0.8)

    def answer(self) -> Answer:
        """Return what is to be found."""
        location, dof = f"hammer:{self.site}", f"t{AXES[self.axis]}"
        return Answer("hammer_misalignment", location, dof, {"rotation": self.vector})

    def to_machine(self, tested: Prepared, occasion: Occasion) -> Prepared:
        """Return the machine with that hammer turned; the hammers of a node come in x, y, z."""
        hammers = list(tested.hammers)
        place = [hammer.node for hammer in hammers].index(self.node) + self.axis
        direction = turn(self.vector) @ hammers[place].direction
        hammers[place] = replace(hammers[place], direction=direction)
        return replace(tested, hammers=tuple(hammers))


@dataclass(frozen=True)
class HammerPosition(Vector):
    """All hits at one point, in all directions, are displaced by a vector.

    Args:
        size: length of the offset [m].
        node: that is hit.
        site: of the drawing, ``hit<node>`` or ``acc<node>``.
    """

    node: int
    site: str
    limits = (1e-3, 0.3)

    def answer(self) -> Answer:
        """Return what is to be found."""
        return Answer("hammer_position", f"hammer:{self.site}", parameters={"offset": self.vector})

    def to_machine(self, tested: Prepared, occasion: Occasion) -> Prepared:
        """Return the machine with the hits of that node elsewhere."""
        hammers = tuple(
            replace(hammer, position=hammer.position + np.array(self.vector))
            if hammer.node == self.node
            else hammer
            for hammer in tested.hammers
        )
        return replace(tested, hammers=hammers)


@draw_at(list_hammers)
def draw_hammer_gain(random: np.random.Generator, scene: Scene, site: str) -> HammerGain:
    """Draw the sign and the size."""
    towards = sign(random)
    size = random.uniform(*(TOO_MUCH if towards > 0 else TOO_LITTLE))
    return HammerGain(site=site, sign=towards, size=size)


@draw_at(list_hammers)
def draw_hammer_delay(random: np.random.Generator, scene: Scene, site: str) -> HammerDelay:
    """Draw the sign and the delay."""
    return HammerDelay(site=site, sign=sign(random), size=log_uniform(random, DELAY))


@draw_at(list_hit_points)
def draw_hammer_misalignment(
    random: np.random.Generator, scene: Scene, node: int
) -> HammerMisalignment:
    """Draw a point and direction that the campaign hits, and the rotation."""
    axes = {occasion.axis for occasion in scene.occasions if occasion.node == node}
    axis, drawn = choose(random, sorted(axes)), scene.station.aim_axes(node)
    return HammerMisalignment(
        node=node,
        site=hammer_site(scene.station, node),
        axis=axis,
        along=unit_vector(random, np.delete(drawn, axis, axis=0)),
        size=random.uniform(*ANGLE),
    )


@draw_at(list_hit_points)
def draw_hammer_position(random: np.random.Generator, scene: Scene, node: int) -> HammerPosition:
    """Draw a point that the campaign hits, and the offset."""
    site, along = hammer_site(scene.station, node), unit_vector(random)
    return HammerPosition(node=node, site=site, along=along, size=log_uniform(random, OFFSET))
