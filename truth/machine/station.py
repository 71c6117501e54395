"""A station in plain values: stages in a tree, their joints, sensors and hammer points.

All positions and directions are in world axes, in SI units, at rest; a small motion does not
change them. Nothing here is changed in place: a variation is made with ``dataclasses.replace``.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from truth.errors import TruthError
from truth.machine.instruments import Hammer, HitPoint, Sensor
from truth.machine.springs import (
    AXES,
    GROUND,
    ClosedLoop,
    Complex,
    Integer,
    Joint,
    Mask,
    Motor,
    Real,
    Remaining,
    Tendon,
    frozen,
    is_inertia,
)

__all__ = [
    "AXES",
    "GROUND",
    "Complex",
    "Hammer",
    "HitPoint",
    "Integer",
    "Joint",
    "Mask",
    "MeshFile",
    "MjcfSource",
    "Motor",
    "Real",
    "Remaining",
    "Sensor",
    "Shape",
    "StageBody",
    "Station",
    "Tendon",
    "frozen",
    "is_inertia",
]


class MjcfSource(Protocol):
    """The compiled model of a station, and the files that it was read from."""

    @property
    def files(self) -> Mapping[str, bytes]:
        """Content of all files by their paths within one folder."""
        ...

    @property
    def entry(self) -> str:
        """Path of the main file among them."""
        ...

    def find_sensed_joint(self, sensor: str) -> tuple[str, int]:
        """Return the joint that a sensor reads, and its time derivatives; an empty name if none."""
        ...


@dataclass(frozen=True)
class Shape:
    """A body's shape for the eye: the attributes of a massless geom, positions in world axes."""

    attributes: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class MeshFile:
    """A mesh that shapes refer to, for the eye only.

    Args:
        name: by which a shape refers to it.
        suffix: of its file, such as ``.stl``.
        content: of its file.
        attributes: how the file is scaled and placed, as in MJCF.
    """

    name: str
    suffix: str
    content: bytes
    attributes: tuple[tuple[str, str], ...] = ()

    @property
    def file(self) -> str:
        """Name of its own file in a campaign."""
        return self.name + self.suffix


@dataclass(frozen=True, eq=False)
class StageBody:
    """A rigid body and what joins it to its parent.

    Args:
        name: of the body.
        parent: index of the parent stage in the station, ``GROUND`` for none.
        mass: [kg].
        com: centre of mass [m]; (3,).
        inertia: about the centre of mass, world axes [kg m2]; (3, 3).
        joints, sensors, hit_points, shapes: what the stage carries.
    """

    name: str
    parent: int
    mass: float
    com: Real
    inertia: Real
    joints: tuple[Joint, ...] = ()
    sensors: tuple[Sensor, ...] = ()
    hit_points: tuple[HitPoint, ...] = ()
    shapes: tuple[Shape, ...] = ()

    def __post_init__(self) -> None:
        """Check that a solid body can have this mass and inertia."""
        if not 0 < self.mass < np.inf:
            raise TruthError(f"body {self.name}: mass {self.mass} must be positive")
        object.__setattr__(self, "com", frozen(self.com, (3,), f"body {self.name}, com"))
        inertia = frozen(self.inertia, (3, 3), f"body {self.name}, inertia")
        if not np.array_equal(inertia, inertia.T) or not is_inertia(inertia):
            raise TruthError(
                f"body {self.name}: no solid body has this inertia; its moments must be positive "
                "and none larger than the sum of the two others"
            )
        object.__setattr__(self, "inertia", inertia)

    @property
    def measured_places(self) -> Real:
        """Where accelerometers stand on it [m]; an encoder stands nowhere; (n, 3)."""
        places = [sensor.position for sensor in self.sensors if not sensor.joint]
        return np.reshape(places, (-1, 3))


@dataclass(frozen=True, eq=False)
class Station:
    """A machine.

    Args:
        name: of the model.
        stages: every parent before its children.
        meshes: of the shapes.
        gravity: [m/s2]; (3,).
        tendons: springs over several joints.
        motors: forces that act on joints.
        loops: control loops that are closed during the test.
        remaining: forces that are neither springs nor weights; None for none.
        source: the compiled MJCF that it was read from, as ``mujoco_reader`` left it; None for a
            station that its own values describe in full.
    """

    name: str
    stages: tuple[StageBody, ...]
    meshes: tuple[MeshFile, ...] = ()
    gravity: Real = field(default_factory=lambda: np.zeros(3))
    tendons: tuple[Tendon, ...] = ()
    motors: tuple[Motor, ...] = ()
    loops: tuple[ClosedLoop, ...] = ()
    remaining: Remaining | None = None
    source: MjcfSource | None = None

    def __post_init__(self) -> None:
        """Check the tree and that every name is given once."""
        if not self.stages:
            raise TruthError(f"model {self.name}: it has no body; give at least one")
        for index, stage in enumerate(self.stages):
            if not GROUND <= stage.parent < index:
                raise TruthError(f"body {stage.name}: its parent must come before it")
        _refuse_twins("body", [stage.name for stage in self.stages])
        _refuse_twins("joint", [joint.name for stage in self.stages for joint in stage.joints])
        _refuse_twins("site", [sensor.site for _, sensor in self.sensors()])
        _refuse_twins("mesh", [mesh.name for mesh in self.meshes])
        hits = [f"hit{hit.node}" for stage in self.stages for hit in stage.hit_points]
        _refuse_twins("site", hits)
        motors = [motor.name for motor in self.motors]
        joints = [joint.name for stage in self.stages for joint in stage.joints]
        for loop in self.loops:
            if loop.motor not in motors or loop.joint not in joints:
                raise TruthError(
                    f"a loop from {loop.joint} to {loop.motor}: a virtual test knows loops that "
                    f"read a joint ({', '.join(joints)}) and drive a motor "
                    f"({', '.join(motors) or 'none'}) alone"
                )

    def sensors(self) -> Iterator[tuple[int, Sensor]]:
        """Go through the sensors in the order of the stages, each with its stage's index."""
        return ((i, sensor) for i, stage in enumerate(self.stages) for sensor in stage.sensors)

    def accelerometers(self) -> Iterator[tuple[int, Sensor]]:
        """Go through the sensors at sites, each with its stage's index."""
        return ((index, sensor) for index, sensor in self.sensors() if not sensor.joint)

    def with_encoders(self, readings: Mapping[str, tuple[str, int]]) -> "Station":
        """Return the station with encoders, whose nodes follow those of sites and hits.

        Args:
            readings: the joint that each reads and its time derivatives, by the encoder's name.
        """
        hits = [hit.node for stage in self.stages for hit in stage.hit_points]
        first = 1 + max([0, *hits, *(sensor.node for _, sensor in self.sensors())])
        encoders = [
            Sensor(node, np.zeros(3), name=name, joint=joint, integrals=2 - order)
            for node, (name, (joint, order)) in enumerate(readings.items(), start=first)
        ]
        stages = []
        for stage in self.stages:
            names = {joint.name for joint in stage.joints}
            read = tuple(encoder for encoder in encoders if encoder.joint in names)
            stages.append(replace(stage, sensors=(*stage.sensors, *read)))
        return replace(self, stages=tuple(stages))

    def vary_joints(self, vary: Callable[[Joint], Joint]) -> "Station":
        """Return the station with every joint varied, in the order of the stages."""
        stages = tuple(
            replace(stage, joints=tuple(vary(joint) for joint in stage.joints))
            for stage in self.stages
        )
        return replace(self, stages=stages)

    def first_aim(self) -> int:
        """Return the node that the hammer hits if nobody says: of a hit point, else of a sensor."""
        hits = [hit.node for stage in self.stages for hit in stage.hit_points]
        nodes = hits or [sensor.node for _, sensor in self.sensors()]
        if not nodes:
            raise TruthError(f"model {self.name}: it has no site acc<node>, nothing is measured")
        return nodes[0]

    def find_sensed_joint(self, sensor: str) -> tuple[str, int]:
        """Return the joint that a sensor of the MJCF reads, empty if none, and its derivatives."""
        return ("", 0) if self.source is None else self.source.find_sensed_joint(sensor)

    def index(self, name: str) -> int:
        """Return the index of the stage of this name, or refuse it."""
        names = [stage.name for stage in self.stages]
        if name not in names:
            raise TruthError(f"body {name!r} is unknown; the model has {', '.join(names)}")
        return names.index(name)

    def aim(self, node: int) -> tuple[int, Real]:
        """Return stage and point of the hammer: the site ``hit<node>``, else the sensor."""
        index, site = self._find_hit_site(node)
        return index, site.position

    def aim_axes(self, node: int) -> Real:
        """Return the directions of the hits at a node, as rows; (3, 3)."""
        return self._find_hit_site(node)[1].axes

    def site(self, node: int) -> str:
        """Return the name of the site of a sensor."""
        names = [sensor.site for _, sensor in self.sensors() if sensor.node == node]
        return names[0] if names else f"acc{node}"

    def _find_hit_site(self, node: int) -> tuple[int, HitPoint | Sensor]:
        """Return stage and site of the hammer."""
        for index, stage in enumerate(self.stages):
            for hit in stage.hit_points:
                if hit.node == node:
                    return index, hit
        for index, sensor in self.sensors():
            if sensor.node == node:
                return index, sensor
        raise TruthError(f"the hammer has no site hit{node} or acc{node} to hit; name another node")


def _refuse_twins(what: str, names: list[str]) -> None:
    twins = {name for name in names if names.count(name) > 1}
    if twins:
        raise TruthError(f"{what} {', '.join(sorted(twins))}: the name is given twice")
