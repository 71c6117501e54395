"""Small machines on test with effects in them, for the tests of the truth's effects."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from truth.effects import Effect, Scene
from truth.machine.rig import Occasion, Prepared, Rig, accelerance, build
from truth.machine.station import GROUND, Hammer, Joint, Sensor, StageBody, Station
from truth.random_streams import stream

FREQ = np.linspace(1.0, 200.0, 160)
OCCASIONS = tuple(Occasion(200.0, 1, axis) for axis in range(3))


def hammers_at(station: Station, node: int = 1) -> tuple[Hammer, ...]:
    """Exact hits in x, y, z at a node."""
    stage, position = station.aim(node)
    return tuple(Hammer(node, stage, position, axis) for axis in np.eye(3))


def machine_of(
    station: Station,
    effects: Sequence[Effect] = (),
    *,
    occasion: Occasion = OCCASIONS[0],
    node: int = 1,
) -> Prepared:
    """A station that is hit at a node, with what effects change before its equations."""
    tested = Prepared(station, hammers_at(station, node))
    for effect in effects:
        tested = effect.to_machine(tested, occasion)
    return tested


def rig_of(
    station: Station,
    effects: Sequence[Effect] = (),
    *,
    occasion: Occasion = OCCASIONS[0],
    node: int = 1,
) -> Rig:
    """The equations of a station that is hit at a node, with effects."""
    tested = machine_of(station, effects, occasion=occasion, node=node)
    rig = build(tested)
    for effect in effects:
        rig = effect.to_rig(rig, tested, occasion)
    return rig


def frf_of(
    station: Station,
    *effects: Effect,
    occasions: Sequence[Occasion] = OCCASIONS,
    freq_hz: np.ndarray = FREQ,
) -> np.ndarray:
    """Accelerance; each occasion gives the column of its direction, (n_freq, n_out, n_occasion)."""
    node = occasions[0].node
    columns = [
        accelerance(rig_of(station, effects, occasion=one, node=node), freq_hz)[:, :, one.axis]
        for one in occasions
    ]
    return np.stack(columns, axis=2)


def scene_of(station: Station, node: int = 1) -> Scene:
    """One test of three directions at a node."""
    return Scene(station, tuple(replace(one, node=node) for one in OCCASIONS))


def random_of(seed: int) -> np.random.Generator:
    return stream(seed, "test")


def chain(*, hinges: bool = False) -> Station:
    """Three bodies on one another, nothing aligned; the last with hinges only if asked."""

    def joints(name: str, position: np.ndarray, scale: float) -> tuple[Joint, ...]:
        values = {"tx": 3e6, "ty": 5e6, "tz": 7e6, "rx": 2e5, "ry": 3e5, "rz": 4e5}
        return tuple(
            Joint(
                name=f"{name}_{dof}",
                kind="slide" if dof[0] == "t" else "hinge",
                axis=np.eye(3)["xyz".index(dof[1])],
                position=position,
                stiffness=scale * value,
                damping=scale * value * 1e-4 * (number + 2),
            )
            for number, (dof, value) in enumerate(values.items())
        )

    def stage(name: str, parent: int, mass: float, com: list[float], scale: float) -> StageBody:
        centre = np.array(com)
        arms = np.array([[0.3, 0.2, 0.1], [-0.3, 0.25, 0.12], [-0.28, -0.2, 0.09], [0.1, -0.2, 0]])
        return StageBody(
            name=name,
            parent=parent,
            mass=mass,
            com=centre,
            inertia=mass * np.array([[0.04, 0.002, 0], [0.002, 0.05, -0.001], [0, -0.001, 0.07]]),
            joints=joints(name, centre - [0.02, -0.03, 0.2], scale),
            sensors=tuple(
                Sensor(4 * (parent + 1) + number, centre + arm)
                for number, arm in enumerate(arms, start=1)
            ),
        )

    base = stage("base", GROUND, 150.0, [0.0, 0.1, 0.2], 1.0)
    arm = stage("arm", 0, 60.0, [0.1, 0.0, 0.6], 0.7)
    head = stage("head", 1, 25.0, [0.05, -0.1, 0.9], 0.5)
    if hinges:
        head = replace(head, joints=head.joints[3:5])
    return Station("chain", (base, arm, head))
