"""The user's own test: its lines, channels, references, levels, averages and noise."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from truth.errors import TruthError
from truth.machine.station import AXES, Real, Station

_LABEL = re.compile(r"(?P<point>[^:]+):(?P<sign>[+-])t(?P<axis>[xyz])")


@dataclass(frozen=True, eq=False)
class StatedTest:
    """One reference of a user's campaign, in the user's own words.

    Args:
        reference: label of the hit, such as ``hit9:-tz``, or name of a motor.
        channels: labels of what was read.
        deviation: standard deviation of each accelerance, real plus imaginary part [m/s2/N];
            (n_freq, n_out).
        level: peak force [N].
        averages: hits.
        setup: name of the set-up; empty without one.
        hammer: name of the hammer or drive; empty if none is stated.
    """

    reference: str
    channels: tuple[str, ...]
    deviation: Real
    level: float
    averages: int
    setup: str = ""
    hammer: str = ""


@dataclass(frozen=True, eq=False)
class MeasuredTest:
    """One reference of a user's campaign, at nodes of the station.

    Args:
        stated: the test in the user's words.
        file: name of its file in virtual campaigns.
        reference: node and axis 0..2 of the hit; a motor has a negative node.
        sign: of the reference.
        channels: node and direction 1..3 of each channel; an encoder's is 1.
        signs: of the channels.
    """

    stated: StatedTest
    file: str
    reference: tuple[int, int]
    sign: int
    channels: tuple[tuple[int, int], ...]
    signs: tuple[int, ...]

    @property
    def level(self) -> float:
        """Peak force [N]."""
        return self.stated.level

    @property
    def setup(self) -> str:
        """Name of the set-up; empty without one."""
        return self.stated.setup


@dataclass(frozen=True, eq=False)
class UserCampaign:
    """A user's campaign.

    Args:
        freq_hz: lines of the band [Hz], above 0; (n_freq,).
        tests: one for each reference of each file.
    """

    freq_hz: Real
    tests: tuple[MeasuredTest, ...]

    @property
    def nodes(self) -> tuple[int, ...]:
        """Nodes that are hit, and motors, each once."""
        return tuple(dict.fromkeys(test.reference[0] for test in self.tests))

    def instrument(self, node: int) -> str:
        """Return the name of the hammer or drive that acts at a node; empty for the default."""
        return next(test.stated.hammer for test in self.tests if test.reference[0] == node)


def locate_tests(station: Station, freq_hz: Real, stated: Sequence[StatedTest]) -> UserCampaign:
    """Return a user's campaign at the sensors, hammer points and motors of a machine.

    Args:
        freq_hz: lines of the band [Hz]; (n_freq,).
        stated: tests in the user's words.

    Raises:
        TruthError: a channel is no encoder or translation of a sensor, or a reference is no hit or
            motor.
    """
    sensors = {sensor.site: sensor.node for _, sensor in station.accelerometers()}
    encoders = {sensor.site: sensor.node for _, sensor in station.sensors() if sensor.joint}
    hits = {f"hit{hit.node}": hit.node for stage in station.stages for hit in stage.hit_points}
    struck = {**{name: node for name, node in sensors.items() if node not in hits.values()}, **hits}
    motors = [motor.name for motor in station.motors]
    tests = []
    for number, test in enumerate(stated):
        if test.reference in motors:
            reference, sign = (-1 - motors.index(test.reference), 0), 1
        else:
            (node, axis), sign = _locate(test.reference, struck, "a hit along an axis, or a motor")
            reference = node, axis
        places = [
            ((encoders[label], 0), 1)
            if label in encoders
            else _locate(label, sensors, "a translation of a sensor")
            for label in test.channels
        ]
        tests.append(
            MeasuredTest(
                test,
                f"test_{number}.npz",
                reference,
                sign,
                tuple((node, axis + 1) for (node, axis), _ in places),
                tuple(sign for _, sign in places),
            )
        )
    return UserCampaign(freq_hz, tuple(tests))


def _locate(label: str, nodes: dict[str, int], kind: str) -> tuple[tuple[int, int], int]:
    """Return node and axis 0..2 of a label, and its sign."""
    match = _LABEL.fullmatch(label)
    if match is None or match["point"] not in nodes:
        known = ", ".join(nodes) or "none"
        raise TruthError(f"{label!r}: a virtual test knows {kind} alone; points are {known}")
    sign = -1 if match["sign"] == "-" else 1
    return (nodes[match["point"]], AXES.index(match["axis"])), sign
