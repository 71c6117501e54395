"""Sensors, hits and joints of a scene, by name."""

from collections.abc import Iterator
from itertools import groupby

import numpy as np

from diagnosis.hypothesis import Hypothesis, Scene, release_tolerance
from identification.words import (
    DEFAULT_HAMMER,
    DIRECTIONS,
    Dof,
    Input,
    is_hammer_point,
    node_number,
)
from mbmodel import WORLD, ChannelPart, Machine, find_ports, parent_bodies


def list_varying_names(scene: Scene) -> set[str]:
    """Return the names of the parameters that vary."""
    return set(scene.session.parametrisation.names)


def list_sensors(scene: Scene) -> list[str]:
    """Return the sites that some test reads, in the order of the layout, then other channels."""
    tests = scene.session.campaign.tests
    measured = {dof.point for test in tests for dof in test.estimate.frf.outputs}
    points = scene.model.machine.layout.points
    sites = [
        p for p in points if p in measured and node_number(p) is not None and not is_hammer_point(p)
    ]
    signals = dict.fromkeys(
        part.channel.point for part in scene.model.parts if isinstance(part, ChannelPart)
    )
    return [*sites, *(point for point in signals if point not in sites)]


def list_references(scene: Scene) -> tuple[Input, ...]:
    """Return the forces and torques at points and the motors that drove the tests."""
    return scene.session.campaign.inputs


def hits(scene: Scene) -> tuple[Dof, ...]:
    """Return the points and directions that forces hit: neither torques nor motors."""
    return tuple(
        reference
        for reference in list_references(scene)
        if isinstance(reference, Dof) and not reference.is_rotation
    )


def list_hidden_bodies(scene: Scene) -> list[str]:
    """Return the bodies that a test of motors or encoders moves, and that no channel shows.

    Nothing is read or pushed at them, nor at what they carry. A test at points alone has none.
    """
    machine, campaign = scene.model.machine, scene.session.campaign
    ports = find_ports(machine, campaign.outputs, campaign.inputs)
    if ports.further is not None or not (ports.joint_readout.any() or ports.motor.any()):
        return []
    is_shown = (ports.readout.any(axis=0) | ports.force.any(axis=1)).reshape(-1, 6).any(axis=1)
    parents, bodies = parent_bodies(machine), machine.layout.bodies
    shown: set[str | None] = set()
    for number in np.flatnonzero(is_shown):
        body: str | None = bodies[number]
        while body is not None and body not in shown:
            shown.add(body)
            body = parents.get(body)
    return [body for body in bodies if body in parents and body not in shown]


def name_vector(prefix: str) -> tuple[str, ...]:
    """Return the names of the components of a vector in world axes."""
    return tuple(f"{prefix}{axis}" for axis in "xyz")


def list_gains(site: str) -> list[tuple[str | None, str]]:
    """Return the directions of a sensor's channels with the names of their gains.

    A signal, such as an encoder, has one channel without direction.
    """
    of_directions = [(d, f"{site}.gain_{d[1:] if d[0] == 't' else d}") for d in DIRECTIONS]
    return [*of_directions, (None, f"{site}.gain")]


def list_delays(site: str) -> list[tuple[str | None, str]]:
    """Return the directions of a sensor's channels with the names of their delays.

    A signal, such as an encoder, has one channel without direction.
    """
    of_directions = [(d, f"{site}.delay_{d[1:] if d[0] == 't' else d}") for d in DIRECTIONS]
    return [*of_directions, (None, f"{site}.delay")]


def list_instruments(scene: Scene) -> tuple[str, ...]:
    """Return the hammers and drives that made the tests, each once."""
    tests = scene.session.campaign.tests
    return tuple(dict.fromkeys(test.condition.instrument for test in tests))


def locate_hammer(scene: Scene, instrument: str) -> str:
    """Return the location of a hammer or drive.

    It is its name, or the first point that it hit if the tests name no hammer.
    """
    if instrument != DEFAULT_HAMMER:
        return f"hammer:{instrument}"
    conditions = (test.condition for test in scene.session.campaign.tests)
    references = [
        condition.reference for condition in conditions if condition.instrument == instrument
    ]
    points = [reference.point for reference in references if isinstance(reference, Dof)]
    return f"hammer:{points[0] if points else instrument}"


def release_hammers(scene: Scene, effect: str, parameter: str) -> Iterator[Hypothesis]:
    """Yield the release of a tolerance of each hammer or drive whose parameter varies.

    Args:
        scene: fit from which hypotheses are proposed.
        parameter: ``gain`` or ``delay``.
    """
    varying = list_varying_names(scene)
    for instrument in list_instruments(scene):
        name = f"hammer({instrument}).{parameter}"
        if name in varying:
            place = locate_hammer(scene, instrument)
            yield release_tolerance(effect, place, None, (name,), parameter)


def find_middle_frequency(scene: Scene) -> float:
    """Return the geometric middle of the band [rad/s]."""
    band = scene.session.campaign.freq_hz
    return 2 * np.pi * float(np.sqrt(band[band > 0].min() * band[-1]))


def scan_resonances(scene: Scene, step: float) -> list[float]:
    """Return the natural frequencies that score tests scan [Hz], from lowest to highest.

    Args:
        scene: its band and its settings give the ends.
        step: between neighbours, of the logarithm.
    """
    band = scene.session.campaign.freq_hz
    lowest, highest = (share * float(band[-1]) for share in scene.settings.appendage_ends)
    lowest = max(float(band[band > 0].min()), lowest)
    count = max(1, round(float(np.log(highest / lowest)) / step)) + 1
    return list(np.geomspace(lowest, highest, count).tolist())


def find_sprung_stages(machine: Machine) -> list[str]:
    """Return the stages whose joints have springs."""
    named = {spring.name for spring in machine.springs}
    stages = groupby(machine.axles, key=lambda axle: axle.stage)
    return [stage for stage, axles in stages if any(axle.joint in named for axle in axles)]


def find_own_springs(machine: Machine, stage: str) -> tuple[str, ...]:
    """Return the names of the springs of a stage's joints."""
    named = {spring.name for spring in machine.springs}
    return tuple(a.joint for a in machine.axles if a.stage == stage and a.joint in named)


def are_joined(machine: Machine, lower: str, upper: str) -> bool:
    """Return whether a joint joins two bodies, or a body and the ground.

    Six directions without a spring join nothing: so the platform of a closed chain and a body that
    hangs on wires have their place in an MJCF.
    """
    pairs = (lower, upper), (upper, lower)
    parents = {body: parent or WORLD for body, parent in parent_bodies(machine).items()}
    return any(parents.get(b) == a and not _is_free(machine, b) for a, b in pairs)


def _is_free(machine: Machine, stage: str) -> bool:
    """Return whether a stage moves in six directions without a spring."""
    joints = {axle.joint for axle in machine.axles if axle.stage == stage}
    stiffness = [spring.stiffness for spring in machine.springs if spring.name in joints]
    return len(joints) == 6 and not any(stiffness)
