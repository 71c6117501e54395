"""A station in plain values: stages in a tree, their joints, sensors and hammer points.

All positions and directions are in world axes, in SI units, at rest; a small motion does not
change them. Nothing here is changed in place: a variation is made with ``dataclasses.replace``.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truth.errors import TruthError

Real: TypeAlias = NDArray[np.float64]
Complex: TypeAlias = NDArray[np.complex128]
Mask: TypeAlias = NDArray[np.bool_]

AXES = ("x", "y", "z")
GROUND = -1


def frozen(values: ArrayLike, shape: tuple[int, ...], what: str) -> Real:
    """Return a finite, read-only copy of the values in this shape, or refuse them by name."""
    array = np.array(values, dtype=np.float64)
    if array.shape != shape or not np.isfinite(array).all():
        raise TruthError(f"{what}: expected finite numbers of shape {shape}, got {values!r}")
    array.setflags(write=False)
    return array


def is_inertia(inertia: Real) -> bool:
    """Tell whether a body can have this inertia: its moments positive, none above the others' sum.

    Both hold exactly when every eigenvalue of ``trace(I)/2 - I`` is non-negative, these being the
    principal second moments of the mass, and when I itself is positive definite.
    """
    moments = np.linalg.eigvalsh(inertia)
    rounding = 1e-9 * float(moments.sum())
    return bool(moments[0] > 0 and moments[2] <= moments[0] + moments[1] + rounding)


@dataclass(frozen=True, eq=False)
class Joint:
    """One direction in which a stage moves against its parent, with a spring and a damper.

    Args:
        name: such as ``ty_rz``.
        kind: ``slide`` along the axis, or ``hinge`` about it.
        axis: unit vector; (3,).
        position: where the joint sits [m]; (3,).
        stiffness: [N/m] or [N m/rad], not negative.
        damping: [N s/m] or [N m s/rad], not negative.
    """

    name: str
    kind: Literal["slide", "hinge"]
    axis: Real
    position: Real
    stiffness: float
    damping: float

    def __post_init__(self) -> None:
        """Check the values and make the axis a unit vector."""
        axis = frozen(self.axis, (3,), f"joint {self.name}, axis")
        if not np.linalg.norm(axis) > 0:
            raise TruthError(f"joint {self.name}: its axis has no length; give a direction")
        unit = frozen(axis / np.linalg.norm(axis), (3,), self.name)
        object.__setattr__(self, "axis", unit)
        position = frozen(self.position, (3,), f"joint {self.name}, pos")
        object.__setattr__(self, "position", position)
        for quantity in ("stiffness", "damping"):
            value = getattr(self, quantity)
            if not 0 <= value < np.inf:
                raise TruthError(f"joint {self.name}: {quantity} {value} is negative or no number")


@dataclass(frozen=True, eq=False)
class Sensor:
    """A triaxial accelerometer.

    Args:
        node: number of the measuring point in the data file.
        position: [m]; (3,).
        axes: the directions 1, 2, 3 as rows, unit vectors; (3, 3).
        gain: reading per true acceleration, for each direction; (3,).
        cross: what x reads of y and y of x, x and z, y and z; (3,).
        delay: of each reading [s]; (3,).
    """

    node: int
    position: Real
    axes: Real = field(default_factory=lambda: np.eye(3))
    gain: Real = field(default_factory=lambda: np.ones(3))
    cross: Real = field(default_factory=lambda: np.zeros(3))
    delay: Real = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        """Check and freeze the values."""
        shapes = {"position": (3,), "axes": (3, 3), "gain": (3,), "cross": (3,), "delay": (3,)}
        for name, shape in shapes.items():
            value = frozen(getattr(self, name), shape, f"sensor {self.node}, {name}")
            object.__setattr__(self, name, value)

    @property
    def mixing(self) -> Real:
        """What each reading takes of the accelerations along the three axes; (3, 3)."""
        xy, xz, yz = self.cross
        across = np.array([[0.0, xy, xz], [xy, 0.0, yz], [xz, yz, 0.0]])
        mixing: Real = np.diag(self.gain) + across
        return mixing


@dataclass(frozen=True, eq=False)
class HitPoint:
    """A place for the hammer that is not a sensor's: node and position [m]; (3,)."""

    node: int
    position: Real

    def __post_init__(self) -> None:
        """Check and freeze the value."""
        position = frozen(self.position, (3,), f"hit{self.node}, position")
        object.__setattr__(self, "position", position)


@dataclass(frozen=True, eq=False)
class Hammer:
    """One hit direction: the stage hit, the point [m] (3,) and the unit direction (3,).

    The force channel makes FRFs gain exp(-s delay) times what they are; one that lags the motion
    has a negative delay.
    """

    node: int
    stage: int
    position: Real
    direction: Real
    gain: float = 1.0
    delay: float = 0.0

    def __post_init__(self) -> None:
        """Check and freeze the values."""
        for name in ("position", "direction"):
            value = frozen(getattr(self, name), (3,), f"hammer at {self.node}, {name}")
            object.__setattr__(self, name, value)


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
class Stage:
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


@dataclass(frozen=True, eq=False)
class Station:
    """A machine: its name, its stages, every parent before its children, and their meshes."""

    name: str
    stages: tuple[Stage, ...]
    meshes: tuple[MeshFile, ...] = ()

    def __post_init__(self) -> None:
        """Check the tree and that every name is given once."""
        if not self.stages:
            raise TruthError(f"model {self.name}: it has no body; give at least one")
        for index, stage in enumerate(self.stages):
            if not GROUND <= stage.parent < index:
                raise TruthError(f"body {stage.name}: its parent must come before it")
        _refuse_twins("body", [stage.name for stage in self.stages])
        _refuse_twins("joint", [joint.name for stage in self.stages for joint in stage.joints])
        _refuse_twins("site", [f"acc{sensor.node}" for _, sensor in self.sensors()])
        _refuse_twins("mesh", [mesh.name for mesh in self.meshes])
        hits = [f"hit{hit.node}" for stage in self.stages for hit in stage.hit_points]
        _refuse_twins("site", hits)

    def sensors(self) -> Iterator[tuple[int, Sensor]]:
        """Go through the sensors in the order of the stages, each with its stage's index."""
        return ((i, sensor) for i, stage in enumerate(self.stages) for sensor in stage.sensors)

    def varied(self, vary: Callable[[Joint], Joint]) -> "Station":
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

    def index(self, name: str) -> int:
        """Return the index of the stage of this name, or refuse it."""
        names = [stage.name for stage in self.stages]
        if name not in names:
            raise TruthError(f"body {name!r} is unknown; the model has {', '.join(names)}")
        return names.index(name)

    def aim(self, node: int) -> tuple[int, Real]:
        """Return stage and point of the hammer: the site ``hit<node>``, else ``acc<node>``."""
        for index, stage in enumerate(self.stages):
            for hit in stage.hit_points:
                if hit.node == node:
                    return index, hit.position
        for index, sensor in self.sensors():
            if sensor.node == node:
                return index, sensor.position
        raise TruthError(f"the hammer has no site hit{node} or acc{node} to hit; name another node")


def _refuse_twins(what: str, names: list[str]) -> None:
    twins = {name for name in names if names.count(name) > 1}
    if twins:
        raise TruthError(f"{what} {', '.join(sorted(twins))}: the name is given twice")
