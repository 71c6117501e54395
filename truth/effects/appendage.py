"""A small mass on a spring and a damper: a cable carrier, a loose cover, a hanging connector."""

from dataclasses import dataclass

import numpy as np

from truth.dynamics import Equations
from truth.effects.effect import Answer
from truth.errors import TruthError
from truth.station import AXES, Station

MASS_RATIO = (0.03, 0.10)
FREQUENCY_HZ = (30.0, 150.0)
DAMPING_RATIO = (0.01, 0.03)


@dataclass(frozen=True)
class Appendage:
    r"""A mass that a spring and a damper hold at a body's centre of mass, along one world axis.

    Its absolute displacement v is a coordinate of its own; with u the centre of mass's,

        m v'' + c (v' - u') + k (v - u) = 0,   k = m (2 pi f)^2,   c = 2 zeta m 2 pi f

    and the body feels k (v - u) + c (v' - u'). In the other directions the mass is not felt.

    Args:
        body: name of the body.
        axis: 0, 1, 2 for tx, ty, tz.
        mass: m [kg].
        frequency: f with the body held still [Hz].
        damping: ratio zeta with the body held still.
    """

    body: str
    axis: int
    mass: float
    frequency: float
    damping: float

    def __post_init__(self) -> None:
        """Check that such a mass can exist."""
        if self.axis not in range(3) or not min(self.mass, self.frequency) > 0 <= self.damping:
            raise TruthError(f"appendage: mass, frequency or axis makes no sense: {self}")

    def answer(self) -> Answer:
        """Return what is to be found."""
        return Answer(
            "appendage",
            location=f"body:{self.body}",
            dof=f"t{AXES[self.axis]}",
            parameters={
                "mass": self.mass,
                "frequency": self.frequency,
                "damping": self.damping,
            },
        )

    def add(self, equations: Equations, station: Station) -> Equations:
        """Return the equations with one coordinate more, the mass's displacement."""
        added = equations.with_coordinate()
        omega = 2 * np.pi * self.frequency
        stretch = np.zeros(added.mass.shape[0])
        stretch[-1] = 1.0
        stretch[6 * station.index(self.body) + self.axis] = -1.0
        spring = self.mass * np.outer(stretch, stretch)
        inertia = np.zeros_like(added.mass)
        inertia[-1, -1] = self.mass
        return Equations(
            mass=added.mass + inertia,
            damping=added.damping + 2 * self.damping * omega * spring,
            stiffness=added.stiffness + omega**2 * spring,
            rigid=added.rigid,
        )


def draw_appendage(random: np.random.Generator, station: Station, body: str | None) -> Appendage:
    """Draw place, direction and parameters; the mass is a share of the body's."""
    # The body is drawn even when one is named, so that naming it leaves the other draws alone.
    drawn = int(random.integers(len(station.stages)))
    stage = station.stages[drawn if body is None else station.index(body)]
    return Appendage(
        body=stage.name,
        axis=int(random.integers(3)),
        mass=stage.mass * random.uniform(*MASS_RATIO),
        frequency=random.uniform(*FREQUENCY_HZ),
        damping=random.uniform(*DAMPING_RATIO),
    )
