"""Mass beyond its tolerance: a payload or a cover that the drawing forgets."""

from dataclasses import dataclass, replace

import numpy as np

from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import draw_stage
from truth.machine.rig import Occasion, Prepared
from truth.machine.station import Real, StageBody

MASS_RATIO = (0.05, 0.25)
LIMITS = (1e-3, 1.0)  # of the body's mass
EXTENT = (0.3, 1.5)  # of the body's radius of gyration, between which its sensors' extent is kept


@dataclass(frozen=True)
class MassError(Sized):
    r"""A point mass m fixed to a body of mass M at p from its centre of mass.

        M' = M + m,   com' = com + m p / M',   I' = I + (m M / M') (|p|^2 1 - p p^T)

    the last being the parallel-axis theorem for both bodies about their common centre.

    Args:
        size: m over M.
        body: name of the body.
        body_mass: M [kg].
        position: p [m], world axes, from the centre of mass without the added mass.
    """

    body: str
    body_mass: float
    position: tuple[float, ...]
    limits = LIMITS

    def answer(self) -> Answer:
        """Return what is to be found."""
        return Answer(
            "mass_error",
            location=f"body:{self.body}",
            parameters={"mass": self.size * self.body_mass, "position": self.position},
        )

    def to_machine(self, tested: Prepared, occasion: Occasion) -> Prepared:
        """Return the machine with a heavier body."""
        index = tested.station.index(self.body)
        stage, added = tested.station.stages[index], self.size * self.body_mass
        return tested.with_stage(index, _ballast(stage, added, np.array(self.position)))


def _ballast(stage: StageBody, mass: float, position: Real) -> StageBody:
    total = stage.mass + mass
    spread = (position @ position) * np.eye(3) - np.outer(position, position)
    return replace(
        stage,
        mass=total,
        com=stage.com + mass / total * position,
        inertia=stage.inertia + mass * stage.mass / total * spread,
    )


def draw_mass_error(
    random: np.random.Generator, scene: Scene, place: str | None
) -> MassError | None:
    """Draw body, mass and position: as far from the centre of mass as the sensors reach."""
    stages = scene.station.stages
    index = draw_stage(random, scene.station, place, "body", range(len(stages)))
    if index is None:
        return None
    stage = stages[index]
    gyration = np.sqrt(np.trace(stage.inertia) / 2 / stage.mass)
    away = [np.abs(sensor.position - stage.com) for sensor in stage.sensors]
    reach = np.clip(np.max([np.zeros(3), *away], axis=0), *(np.array(EXTENT) * gyration))
    position = reach * random.uniform(-1, 1, 3)
    return MassError(
        body=stage.name,
        body_mass=stage.mass,
        position=tuple(position.tolist()),
        size=random.uniform(*MASS_RATIO),
    )
