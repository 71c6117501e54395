"""A body that bends or twists in a mode of its own."""

from dataclasses import dataclass, replace

import numpy as np

from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import draw_stage, log_uniform, unit_vector
from truth.machine.dynamics import Flex
from truth.machine.rig import Occasion, Prepared
from truth.machine.station import Real, Station

AMPLITUDE = (0.3, 1.5)
FREQUENCY_HZ = (60.0, 300.0)
DAMPING_RATIO = (0.003, 0.02)
LIMITS = (1e-3, 3.0)
LEAST_SENSORS = 3
NO_DRIFT = (0.0,) * 6


@dataclass(frozen=True, eq=False)
class Bend:
    r"""A plate's bending: translation and rotation of its points per modal coordinate.

    The plate lies through the centre of mass, its normal n the axis along which the places where it
    is measured reach least; without such places, those where it is held. With x, y the position
    along the two other axes over the half extent L and z the height above the plate's middle,
    straight normals give (Kirchhoff)

        w = a x^2 + b x y + c y^2,   u = w n - z grad w,   rotation = curl u / 2 = grad w x n

    minus the rigid motion (t, phi) that fits u best at the sensors and joints, so that the mode
    hardly moves the body as a whole.

    Args:
        centre: [m]; (3,).
        normal: 0, 1, 2 for n.
        reach: L [m].
        bending: a, b, c.
        drift: t and phi; (6,).
    """

    centre: Real
    normal: int
    reach: float
    bending: tuple[float, ...]
    drift: tuple[float, ...] = NO_DRIFT

    def __call__(self, position: Real) -> Real:
        """Return translation [m] and rotation [rad] of a position [m]; (6,)."""
        a, b, c = self.bending
        away = position - self.centre
        x, y = np.delete(away, self.normal) / self.reach
        normal = np.eye(3)[self.normal]
        slope = np.insert(np.array([2 * a * x + b * y, b * x + 2 * c * y]), self.normal, 0.0)
        slope /= self.reach
        bent = (a * x * x + b * x * y + c * y * y) * normal - away[self.normal] * slope
        shift, turn = np.split(np.array(self.drift), 2)
        rigid = np.concatenate([shift + np.cross(turn, away), turn])
        return np.concatenate([bent, np.cross(slope, normal)]) - rigid


def bend_of(station: Station, index: int, bending: tuple[float, ...]) -> Bend:
    """Return a stage's bending, without the rigid motion of its sensors and joints."""
    stage = station.stages[index]
    extent = np.ptp(_find_ends(station, index), axis=0)
    bent = Bend(stage.com, int(extent.argmin()), float(extent.max()) / 2, bending)
    points = np.unique([*stage.measured_places, *_list_held(station, index)], axis=0)
    rows = []
    for away in points - stage.com:
        # phi x away = -away x phi
        rows.append(np.hstack([np.eye(3), -np.cross(away, np.eye(3)).T]))
    translations = np.concatenate([bent(point)[:3] for point in points])
    drift = np.linalg.lstsq(np.vstack(rows), translations, rcond=None)[0]
    return replace(bent, drift=tuple(drift.tolist()))


def _list_held(station: Station, index: int) -> list[Real]:
    """Return where joints hold a stage, below and above."""
    above = [child for child in station.stages if child.parent == index]
    bodies = station.stages[index], *above
    return [joint.position for body in bodies for joint in body.joints]


def _find_ends(station: Station, index: int) -> Real:
    """Return places that span a stage: where it is measured, else its centre and joints; (n, 3)."""
    stage = station.stages[index]
    if len(stage.measured_places):
        return stage.measured_places
    return np.array([stage.com, *_list_held(station, index)])


@dataclass(frozen=True)
class FlexibleBody(Sized):
    """One mode of a stage's own, its modal mass the body's.

    Args:
        size: the shape's amplitude: 1 bends the edge of the sensors' extent by about 1 m per
            modal coordinate, as a mode of a free plate does by 2.
        body: name of the body.
        bending: a, b, c of the shape, a unit vector.
        frequency: with the rigid motion held [Hz].
        damping: ratio.
    """

    body: str
    bending: tuple[float, ...]
    frequency: float
    damping: float
    limits = LIMITS

    def answer(self) -> Answer:
        """Return what is to be found."""
        parameters = {"frequency": self.frequency, "damping": self.damping}
        return Answer("flexible_body", location=f"body:{self.body}", parameters=parameters)

    def to_machine(self, tested: Prepared, occasion: Occasion) -> Prepared:
        """Return the machine with the stage's mode."""
        index = tested.station.index(self.body)
        bending = tuple(self.size * coefficient for coefficient in self.bending)
        flex = Flex(
            stage=index,
            shape=bend_of(tested.station, index, bending),
            mass=tested.station.stages[index].mass,
            frequency=self.frequency,
            damping=self.damping,
        )
        return replace(tested, flexes=(*tested.flexes, flex))


def draw_flexible_body(
    random: np.random.Generator, scene: Scene, place: str | None
) -> FlexibleBody | None:
    """Draw a body that its test shows, the shape of its mode, frequency and damping."""
    stages = scene.station.stages
    choices = [i for i in range(len(stages)) if _shows(scene.station, i)]
    index = draw_stage(random, scene.station, place, "body", choices)
    if index is None:
        return None
    return FlexibleBody(
        body=stages[index].name,
        bending=unit_vector(random),
        frequency=scene.pace * log_uniform(random, FREQUENCY_HZ),
        damping=log_uniform(random, DAMPING_RATIO),
        size=random.uniform(*AMPLITUDE),
    )


def _shows(station: Station, index: int) -> bool:
    """Return whether sensors on a stage show its mode, or encoders where nothing else measures."""
    stage = station.stages[index]
    above = (child for child in station.stages if child.parent == index)
    is_read = any(sensor.joint for body in (stage, *above) for sensor in body.sensors)
    is_shown = len(stage.measured_places) >= LEAST_SENSORS or (
        is_read and not any(station.accelerometers())
    )
    return is_shown and bool(np.ptp(_find_ends(station, index), axis=0).max() > 0)
