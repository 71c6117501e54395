"""A small mass on a spring and a damper: a cable carrier, a loose cover, a hanging connector."""

from dataclasses import dataclass

import numpy as np

from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import body_motion, draw_stage
from truth.machine.rig import Occasion, Prepared, Rig
from truth.machine.station import AXES

MASS_RATIO = (0.03, 0.10)
FREQUENCY_HZ = (30.0, 150.0)
DAMPING_RATIO = (0.01, 0.03)
LIMITS = (1e-4, 0.5)  # of the body's mass
KINDS = ((1.0, 0.0), (1.0, 1.0), (0.0, 0.0), (0.0, 0.0))  # across, counted: boxes, then cables


@dataclass(frozen=True)
class Appendage(Sized):
    r"""A mass that a spring and a damper hold at a body's centre of mass, along one world axis.

    Its absolute displacement v is a coordinate of its own; with u the centre of mass's,

        m v'' + c (v' - u') + k (v - u) = 0,   k = m (2 pi f)^2,   c = 2 zeta m 2 pi f

    and the body feels k (v - u) + c (v' - u'). Across the axis a cable's mass is not felt; a box
    on flexures is rigid there. The nominal body may hold the mass of the box, as a rigid part.

    Args:
        body: name of the body.
        body_mass: its mass [kg].
        axis: 0, 1, 2 for tx, ty, tz.
        size: m over the body's mass.
        frequency: f with the body held still [Hz].
        damping: ratio zeta with the body held still.
        across: share of m that moves with the body across the axis.
        counted: share of m that the nominal body's mass holds.
    """

    body: str
    body_mass: float
    axis: int
    frequency: float
    damping: float
    across: float = 0.0
    counted: float = 0.0
    limits = LIMITS

    def __post_init__(self) -> None:
        """Check that such a mass can exist."""
        super().__post_init__()
        self.require(self.axis in range(3) and self.frequency > 0 <= self.damping)

    def answer(self) -> Answer:
        """Return what is to be found."""
        return Answer(
            "appendage",
            location=f"body:{self.body}",
            dof=f"t{AXES[self.axis]}",
            parameters={
                "mass": self.size * self.body_mass,
                "frequency": self.frequency,
                "damping": self.damping,
            },
        )

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with one coordinate more, the mass's displacement."""
        added = rig.with_coordinate()
        omega, mass = 2 * np.pi * self.frequency, self.size * self.body_mass
        index = tested.station.index(self.body)
        com = tested.station.stages[index].com
        motion = body_motion(added, tested, index, com)[:3]
        stretch = -motion[self.axis]
        stretch[-1] = 1.0
        spring = mass * np.outer(stretch, stretch)
        beside = np.delete(motion, self.axis, axis=0)
        inertia = mass * (self.across * beside.T @ beside - self.counted * motion.T @ motion)
        inertia[-1, -1] += mass
        return added.with_matrices(inertia, 2 * self.damping * omega * spring, omega**2 * spring)


def draw_appendage(
    random: np.random.Generator, scene: Scene, place: str | None
) -> Appendage | None:
    """Draw place, direction and parameters; the mass is a share of the body's."""
    stages = scene.station.stages
    index = draw_stage(random, scene.station, place, "body", range(len(stages)))
    if index is None:
        return None
    stage = stages[index]
    (kinds,) = random.spawn(1)  # the draws of what follows stay as they were
    return Appendage(
        body=stage.name,
        body_mass=stage.mass,
        axis=int(random.integers(3)),
        size=random.uniform(*MASS_RATIO),
        frequency=scene.pace * random.uniform(*FREQUENCY_HZ),
        damping=random.uniform(*DAMPING_RATIO),
        **dict(zip(("across", "counted"), KINDS[kinds.integers(len(KINDS))], strict=True)),
    )
