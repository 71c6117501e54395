"""Further tests of one machine: one hammer point, sensor or level more, and what each would show.

A further hammer point is hit along its three axes, with the noise of the hit that reads most
channels. A further sensor reads its three axes in every test, with the median noise of the channels
there. Twice the force halves the noise of a reading, and twice the hits divide it by the root of 2.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from truth.campaign.measured import MeasuredTest
from truth.campaign.place_names import named_place
from truth.campaign.protocol import Protocol
from truth.effects.places import hammer_site
from truth.errors import TruthError
from truth.machine.station import AXES, Station

HITS, FORCE = "twice the hits", "twice the force"


@dataclass(frozen=True, eq=False)
class FurtherTest:
    """A test with one thing more.

    Args:
        name: ``hammer point <site>``, ``sensor <site>``, or what is done twice.
        protocol: the whole test with it.
    """

    name: str
    protocol: Protocol


def list_further_tests(station: Station, protocol: Protocol) -> list[FurtherTest]:
    """Return all further tests of a machine.

    Args:
        station: the nominal machine.
    """
    points = [
        FurtherTest(f"hammer point {_hit_name(station, node)}", _add_hits(station, protocol, node))
        for node in _nodes(station)
        if node not in protocol.nodes and _can_hit(protocol)
    ]
    sensors = [
        FurtherTest(f"sensor {station.site(node)}", _read(station, protocol, node))
        for node in _unread(station, protocol)
    ]
    return [
        *points,
        *sensors,
        FurtherTest(HITS, _repeat(protocol, hits=2.0, force=1.0)),
        FurtherTest(FORCE, _repeat(protocol, hits=1.0, force=2.0)),
    ]


def find_further_test(station: Station, protocol: Protocol, name: str) -> FurtherTest:
    """Return the further test of a name.

    Raises:
        TruthError: there is none.
    """
    tests = {test.name: test for test in list_further_tests(station, protocol)}
    if name not in tests:
        raise TruthError(f"{name!r} is no further test; there are {', '.join(tests)}")
    return tests[name]


def _nodes(station: Station) -> list[int]:
    """Return all nodes that a hammer can hit."""
    hits = [hit.node for stage in station.stages for hit in stage.hit_points]
    return sorted({*hits, *(sensor.node for _, sensor in station.accelerometers())})


def _hit_name(station: Station, node: int) -> str:
    """Return the site of a hammer point as the model names it."""
    return named_place(f"hammer:{hammer_site(station, node)}", station).partition(":")[2]


def _can_hit(protocol: Protocol) -> bool:
    """Tell whether the noise of a hit is known: a user's test may have motors alone."""
    return protocol.measured is None or any(node >= 0 for node in protocol.nodes)


def _add_hits(station: Station, protocol: Protocol, node: int) -> Protocol:
    """Return the test with hits along the three axes of a node."""
    measured = protocol.measured
    if measured is None:
        return replace(protocol, nodes=(*protocol.nodes, node))
    hits = [test for test in measured.tests if test.reference[0] >= 0]
    like = max(hits, key=lambda test: len(test.channels))
    site = hammer_site(station, node)
    added = tuple(
        replace(
            like,
            stated=replace(like.stated, reference=f"{site}:+t{axis}"),
            file=f"further_{axis}.npz",
            reference=(node, number),
            sign=1,
        )
        for number, axis in enumerate(AXES)
    )
    return _with_tests(protocol, (*measured.tests, *added))


def _unread(station: Station, protocol: Protocol) -> Iterator[int]:
    """Go through the sensors that a user's test does not read."""
    if protocol.measured is None:
        return
    read = {node for test in protocol.measured.tests for node, _ in test.channels}
    yield from (sensor.node for _, sensor in station.sensors() if sensor.node not in read)


def _read(station: Station, protocol: Protocol, node: int) -> Protocol:
    """Return the test with a further sensor in every file."""
    measured = protocol.measured
    if measured is None:
        raise TruthError("a virtual test reads all sensors")
    site = station.site(node)

    def widen(test: MeasuredTest) -> MeasuredTest:
        deviation = test.stated.deviation
        noise = np.repeat(np.median(deviation, axis=1)[:, None], len(AXES), axis=1)
        labels = tuple(f"{site}:+t{axis}" for axis in AXES)
        stated = replace(
            test.stated,
            channels=(*test.stated.channels, *labels),
            deviation=np.hstack([deviation, noise]),
        )
        channels = tuple((node, number) for number in range(1, len(AXES) + 1))
        return replace(
            test,
            stated=stated,
            channels=(*test.channels, *channels),
            signs=(*test.signs, *(1 for _ in AXES)),
        )

    return _with_tests(protocol, tuple(widen(test) for test in measured.tests))


def _repeat(protocol: Protocol, *, hits: float, force: float) -> Protocol:
    """Return the test with so many times the hits and the force."""
    measured = protocol.measured
    louder = replace(
        protocol,
        averages=round(hits * protocol.averages),
        levels=tuple(force * level for level in protocol.levels),
    )
    if measured is None:
        return louder
    tests = tuple(
        replace(
            test,
            stated=replace(
                test.stated,
                averages=round(hits * test.stated.averages),
                level=force * test.stated.level,
                deviation=test.stated.deviation / (force * np.sqrt(hits)),
            ),
        )
        for test in measured.tests
    )
    return _with_tests(louder, tests)


def _with_tests(protocol: Protocol, tests: tuple[MeasuredTest, ...]) -> Protocol:
    """Return a user's test with other files."""
    if protocol.measured is None:
        raise TruthError("a virtual test has no measured files")
    measured = replace(protocol.measured, tests=tests)
    return replace(protocol, nodes=measured.nodes, measured=measured)
