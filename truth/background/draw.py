"""Draw the background of a machine: what every real machine has, none of it worth naming.

At scale 1 every item has the size that good machines have. One scale multiplies all of them, so
that the background can be made to leave a given part of the motion.

Imperfections that no effect of the catalogue has: delays of single channels, guides askew.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from truth.effects.body_errors import Appendage
from truth.effects.effect import Answer, Effect, Scene, Sized
from truth.effects.flexible_body import draw_flexible_body
from truth.effects.frequency_laws import StructuralDamping
from truth.effects.parallel_path import draw_parallel_path
from truth.effects.places import log_uniform
from truth.effects.sensor_errors import REFERENCE_HZ, MountResonance
from truth.effects.sensors import outputs
from truth.errors import TruthError
from truth.machine.rig import Filter, Occasion, Prepared, Rig, respond_late
from truth.machine.station import Real, StageBody, Station
from truth.random_streams import stream

# Sizes at scale 1.
CHANNEL_DELAY_S = 20e-6  # s, the longest of a sensor's three channels
MOUNT_HZ = (1.5e3, 4e3)  # Hz, resonances of the sensors' mountings
MOUNT_DAMPING = (0.02, 0.1)
LOSS_FACTOR = (0.002, 0.02)
ASKEW_RAD = 0.01  # rad, standard deviation of the turn of a joint's axis
COVER_MASS = (0.001, 0.004)  # of the stage's mass
COVER_HZ = (30.0, 300.0)
COVER_DAMPING = (0.01, 0.05)
CABLES = 3
CABLE_STIFFNESS = (0.0005, 0.005)  # of the mean stiffness of the joints that it bypasses
BODY_MODE = (1.2, 2.5)  # its frequency over the end of the band: above it
BODY_MODE_SIZE = (0.1, 0.5)
BODY_MODE_DAMPING = (0.003, 0.02)


@dataclass(frozen=True, eq=False)
class Background:
    """The imperfections of a machine.

    Args:
        items: effects at scale 1.
        scale: factor on the size of each.
        left: relative motion that they leave after a refit, for each channel; (n_out, n_in), or
            None if that was not computed.
    """

    items: tuple[Effect, ...] = ()
    scale: float = 1.0
    left: Real | None = None

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The items at their sizes."""
        return tuple(item.sized(self.scale * float(item.size or 0.0)) for item in self.items)

    def rescale(self, factor: float) -> "Background":
        """Return the background with every size multiplied by a factor."""
        return replace(self, scale=self.scale * factor)


def draw_background(
    station: Station, highest_hz: float, seed: int, *, has_losses: bool = True
) -> Background:
    """Draw the background of a machine at scale 1.

    Args:
        station: the true machine.
        highest_hz: end of the band of its test [Hz].
        seed: seed of the campaign.
        has_losses: whether joints have loss factors, which the time domain cannot hold.
    """
    kinds = [_delays, _mounts, _guides, _covers, _cables, _body_modes]
    if has_losses:
        kinds.append(_losses)
    items = [
        item
        for kind in kinds
        for item in kind(station, highest_hz, stream(seed, f"background{kind.__name__}"))
    ]
    return Background(tuple(items))


def _delays(station: Station, _: float, random: np.random.Generator) -> Iterator[Effect]:
    for _index, sensor in station.accelerometers():
        first, second, third = random.uniform(0, 1, 3).tolist()
        yield ChannelDelays(size=CHANNEL_DELAY_S, node=sensor.node, shares=(first, second, third))


def _mounts(station: Station, _: float, random: np.random.Generator) -> Iterator[Effect]:
    for _index, sensor in station.accelerometers():
        size = (REFERENCE_HZ / log_uniform(random, MOUNT_HZ)) ** 2
        yield MountResonance(
            size=size, node=sensor.node, damping=log_uniform(random, MOUNT_DAMPING)
        )


def _losses(station: Station, _: float, random: np.random.Generator) -> Iterator[Effect]:
    for stage in _list_jointed_stages(station):
        if any(joint.stiffness > 0 for joint in stage.joints):
            size = random.uniform(*LOSS_FACTOR)
            yield StructuralDamping(size=size, stage=stage.name, share=1.0)


def _guides(station: Station, _: float, random: np.random.Generator) -> Iterator[Effect]:
    for stage in _list_jointed_stages(station):
        turns = random.standard_normal((len(stage.joints), 3)).tolist()
        yield AskewGuides(
            size=ASKEW_RAD, stage=stage.name, turns=tuple((x, y, z) for x, y, z in turns)
        )


def _covers(station: Station, _: float, random: np.random.Generator) -> Iterator[Effect]:
    for stage in station.stages:
        yield Appendage(
            body=stage.name,
            body_mass=stage.mass,
            axis=int(random.integers(3)),
            size=random.uniform(*COVER_MASS),
            frequency=log_uniform(random, COVER_HZ),
            damping=log_uniform(random, COVER_DAMPING),
        )


def _cables(station: Station, _: float, random: np.random.Generator) -> Iterator[Effect]:
    scene = Scene(station, ())
    for _number in range(CABLES):
        cable = draw_parallel_path(random, scene, None)
        if cable is not None:
            yield cable.sized(log_uniform(random, CABLE_STIFFNESS))


def _body_modes(
    station: Station, highest_hz: float, random: np.random.Generator
) -> Iterator[Effect]:
    """Yield a mode above the band for every body that has sensors enough to show it."""
    scene = Scene(station, ())
    for stage in station.stages:
        try:
            bend = draw_flexible_body(random, scene, f"body:{stage.name}")
        except TruthError:
            continue
        if bend is not None:
            yield replace(
                bend,
                size=random.uniform(*BODY_MODE_SIZE),
                frequency=highest_hz * log_uniform(random, BODY_MODE),
                damping=log_uniform(random, BODY_MODE_DAMPING),
            )


def _list_jointed_stages(station: Station) -> list[StageBody]:
    return [stage for stage in station.stages if stage.joints]


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
        filters = tuple(
            Filter((row,), partial(respond_late, share * self.size))
            for row, share in zip(outputs(tested.station, self.node), self.shares, strict=True)
        )
        return replace(rig, filters=(*rig.filters, *filters))


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
        index = tested.station.index(self.stage)
        stage = tested.station.stages[index]
        joints = tuple(
            replace(joint, axis=joint.axis + self.size * np.cross(turn, joint.axis))
            for joint, turn in zip(stage.joints, self.turns, strict=True)
        )
        return tested.with_stage(index, replace(stage, joints=joints))
