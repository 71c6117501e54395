"""Sensors and hammers of a station: places, directions, gains and delays."""

from dataclasses import dataclass, field

import numpy as np

from truth.machine.springs import Real, frozen


@dataclass(frozen=True, eq=False)
class Sensor:
    """A triaxial accelerometer, or an encoder, whose one reading counts as three alike.

    Args:
        node: number of the measuring point in the data file.
        position: [m]; (3,).
        axes: the directions 1, 2, 3 as rows, unit vectors; (3, 3).
        gain: reading per true acceleration, for each direction; (3,).
        cross: what x reads of y and y of x, x and z, y and z; (3,).
        delay: of each reading [s]; (3,).
        name: of its site, ``acc<node>`` if empty.
        joint: whose coordinate an encoder reads, wherever it is; empty for an accelerometer.
        integrals: of the acceleration over time that it reads: 2 for a position.
    """

    node: int
    position: Real
    axes: Real = field(default_factory=lambda: np.eye(3))
    gain: Real = field(default_factory=lambda: np.ones(3))
    cross: Real = field(default_factory=lambda: np.zeros(3))
    delay: Real = field(default_factory=lambda: np.zeros(3))
    name: str = ""
    joint: str = ""
    integrals: int = 0

    @property
    def site(self) -> str:
        """Name of its site."""
        return self.name or f"acc{self.node}"

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
        return np.diag(self.gain) + across


@dataclass(frozen=True, eq=False)
class HitPoint:
    """A place for the hammer that is not a sensor's.

    Args:
        node: number of the measuring point.
        position: [m]; (3,).
        axes: the directions 1, 2, 3 as rows, unit vectors; (3, 3).
    """

    node: int
    position: Real
    axes: Real = field(default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        """Check and freeze the value."""
        position = frozen(self.position, (3,), f"hit{self.node}, position")
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "axes", frozen(self.axes, (3, 3), f"hit{self.node}, axes"))


@dataclass(frozen=True, eq=False)
class Hammer:
    """One hit direction: the stage hit, the point [m] (3,) and the unit direction (3,).

    A motor instead has generalised forces along joints, by their names, per unit of its control.
    All hits of one instrument share gain and delay. The force channel makes FRFs gain exp(-s delay)
    times what they are; one that lags the motion has a negative delay.
    """

    node: int
    stage: int
    position: Real
    direction: Real
    gain: float = 1.0
    delay: float = 0.0
    along: tuple[tuple[str, float], ...] = ()
    instrument: str = ""

    def __post_init__(self) -> None:
        """Check and freeze the values."""
        for name in ("position", "direction"):
            value = frozen(getattr(self, name), (3,), f"hammer at {self.node}, {name}")
            object.__setattr__(self, name, value)
