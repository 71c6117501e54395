"""How a campaign is measured: hammer points, levels, set-ups, lines; never what is wrong.

Everything here is drawn, if at all, from random numbers that know nothing of the cause.
"""

from dataclasses import dataclass, replace

import numpy as np

from truth.campaign.measured import MeasuredTest, UserCampaign
from truth.errors import TruthError
from truth.machine.rig import Occasion
from truth.machine.station import Real, Station
from truth.random_streams import stream

Channel = tuple[int, int]  # node and direction 1, 2, 3

_AVERAGES = (5, 8, 10, 10, 10, 15)
_LEVELS = (100.0, 150.0, 200.0, 200.0, 300.0)
# Levels of a test at three, as parts of the middle one; the return tells a law from a drift.
_THREE_AND_BACK = (0.2, 1.0, 5.0, 0.2)
_GRIDS = ((801, 0.25), (801, 0.25), (401, 0.5), (1601, 0.125), (601, 0.25), (1001, 0.25))
_LEAST_SETUP = 2  # sensors in a set-up


@dataclass(frozen=True)
class Protocol:
    """What is measured, and how.

    Args:
        nodes: measuring points that the hammer hits; none: the station's first hit point.
        levels: mean peak forces [N], one test file each; a level that returns is measured again.
        averages: hits per direction.
        setups: how many set-ups the sensors are moved through.
        lines: number of lines from 0 Hz.
        resolution_hz: their spacing.
        coherence: whether the file has coherences.
        dead: a channel that reads its noise alone.
        scale: band over that of a usual station's test; hits are as much shorter. None: 1.
        measured: the user's own test, which says lines, channels and noise; None for a virtual one.
    """

    nodes: tuple[int, ...] = (11,)
    levels: tuple[float, ...] = (200.0,)
    averages: int = 10
    setups: int = 1
    lines: int = 801
    resolution_hz: float = 0.25
    coherence: bool = True
    dead: Channel | None = None
    scale: float | None = None
    measured: UserCampaign | None = None

    def __post_init__(self) -> None:
        """Check that the test can be made."""
        if self.averages < 2:
            raise TruthError(
                f"averages {self.averages}: a coherence needs at least 2 hits per direction"
            )
        for level in self.levels:
            if not 0 < level < np.inf:
                raise TruthError(f"level {level}: give the hammer's peak force in N, more than 0")

    @property
    def pace(self) -> float:
        """Band over that of a usual station's test."""
        return self.scale or 1.0

    @property
    def freq_hz(self) -> Real:
        """Lines [Hz]; (n_freq,)."""
        if self.measured is not None:
            return self.measured.freq_hz
        return self.resolution_hz * np.arange(self.lines, dtype=np.float64)


@dataclass(frozen=True)
class Take:
    """One file of a campaign: a level and a set-up.

    Args:
        file: its name.
        level: mean peak force [N].
        setup: name of the set-up; empty if there is one alone.
        channels: what is recorded, sorted.
        test: the user's own test of this file; None for a virtual one.
        visit: number of the visit to a level, from 0.
    """

    file: str
    level: float
    setup: str
    channels: tuple[Channel, ...]
    test: MeasuredTest | None = None
    visit: int = 0


def takes(protocol: Protocol, station: Station, seed: int) -> tuple[Take, ...]:
    """Return the files of a campaign; a set-up takes some of the sensors."""
    if protocol.measured is not None:
        return tuple(
            Take(test.file, test.level, test.setup, test.channels, test)
            for test in protocol.measured.tests
        )
    nodes = sorted(sensor.node for _, sensor in station.sensors())
    count = min(protocol.setups, max(1, len(nodes) // _LEAST_SETUP))
    order = stream(seed, "protocol.setups").permutation(len(nodes))
    files = []
    for place, level in enumerate(protocol.levels):
        again = protocol.levels[:place].count(level)
        for number in range(count):
            setup = chr(ord("a") + number) if count > 1 else ""
            members = sorted(nodes[place] for place in order[number::count])
            suffix = (f"_{setup}" if setup else "") + (f"_again{again}" if again else "")
            files.append(
                Take(
                    f"impact_{level:g}N{suffix}.uff",
                    level,
                    setup,
                    tuple((node, axis) for node in members for axis in (1, 2, 3)),
                    visit=place,
                )
            )
    return tuple(files)


def occasions(protocol: Protocol, files: tuple[Take, ...]) -> tuple[Occasion, ...]:
    """Return one occasion for every column of every file, and none of its hits."""
    return tuple(occasion for take in files for occasion in take_occasions(protocol, take))


def take_occasions(protocol: Protocol, take: Take) -> tuple[Occasion, ...]:
    """Return one occasion for every column of a file."""
    if take.test is not None:
        node, axis = take.test.reference
        return (Occasion(take.level, node, axis, take.setup, label=take.test.stated.reference),)
    return tuple(
        Occasion(take.level, node, axis, take.setup, visit=take.visit)
        for node in protocol.nodes
        for axis in range(3)
    )


def draw_protocol(station: Station, seed: int) -> Protocol:
    """Draw how a campaign is measured; most are plain, each variant comes in about one of six."""
    random = stream(seed, "protocol")
    sensors = [sensor.node for _, sensor in station.sensors()]
    hits = [hit.node for stage in station.stages for hit in stage.hit_points]
    first = int(random.permutation(hits or sensors)[0])
    second = int(random.permutation([node for node in sensors if node != first] or [first])[0])
    level = float(random.choice(_LEVELS))
    lines, resolution = _GRIDS[int(random.integers(len(_GRIDS)))]
    dead = (int(random.choice(sensors)), int(random.integers(1, 4)))
    plain = Protocol((first,), (level,), int(random.choice(_AVERAGES)))
    setups = int(random.integers(2, 6))
    variant = random.random(6) < 1 / 6
    if variant[0] and second != first:
        plain = replace(plain, nodes=(first, second))
    if variant[1]:
        plain = replace(plain, setups=setups)
    if variant[2]:
        plain = replace(plain, levels=tuple(level * part for part in _THREE_AND_BACK))
    if variant[3]:
        plain = replace(plain, coherence=False)
    if variant[4]:
        plain = replace(plain, dead=dead)
    if variant[5]:
        plain = replace(plain, lines=lines, resolution_hz=resolution)
    return plain
