"""Draw a machine, its drawing, and how the machine differs from the drawing within tolerances.

Three stations come out of one nominal station:

* the *basis*: a machine of its own, with masses, stiffness and damping around the nominal ones;
* the *drawing*: the basis with its stiffness and damping wrong, which is what the user is given;
* the *true* machine: the basis with every tolerance at work, which is what is hit.

Each purpose draws from a random stream of its own, so a new purpose leaves the others alone.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from truth.errors import TruthError
from truth.machine.springs import Motor
from truth.machine.station import (
    GROUND,
    Hammer,
    Joint,
    Real,
    Sensor,
    StageBody,
    Station,
    is_inertia,
)
from truth.random_streams import stream

# Standard deviations of the logarithms: a machine about the nominal, a drawing about the machine.
SPREAD_MASS = 0.1
SPREAD_STIFFNESS = SPREAD_DAMPING = 0.3
DRAWN_STIFFNESS = 0.3
DRAWN_DAMPING = 0.5


@dataclass(frozen=True)
class Tolerances:
    """One standard deviation of what a drawing says; the fields as in ``campaign.toml``."""

    mass: float = 0.02
    inertia: float = 0.05
    com: float = 0.003
    joint_position: float = 0.003
    sensor_gain: float = 0.01
    sensor_angle: float = 0.01745
    sensor_position: float = 0.0015
    hammer_angle: float = 0.01745
    hammer_position: float = 0.003
    sensor_delay: float = 0.0
    sensor_cross: float = 0.0
    hammer_gain: float = 0.0
    hammer_delay: float = 0.0


NO_TOLERANCE = Tolerances(*(0.0,) * 13)
# With delays, cross-talk and calibration of the force at work too, as in any real test.
REAL_INSTRUMENTS = Tolerances(
    sensor_delay=2e-5, sensor_cross=0.014, hammer_gain=0.02, hammer_delay=2e-5
)


def draw_basis(nominal: Station, seed: int) -> Station:
    """Return a machine of its own; a stage's inertia grows with its mass, the geometry stays."""
    factors = np.exp(SPREAD_MASS * stream(seed, "basis.mass").standard_normal(len(nominal.stages)))
    heavier = tuple(
        replace(stage, mass=stage.mass * factor, inertia=stage.inertia * factor)
        for stage, factor in zip(nominal.stages, factors.tolist(), strict=True)
    )
    return _with_joint_factors(
        replace(nominal, stages=heavier),
        stiffness=(SPREAD_STIFFNESS, stream(seed, "basis.stiffness")),
        damping=(SPREAD_DAMPING, stream(seed, "basis.damping")),
    )


def draw_rigid(basis: Station, count: int, seed: int) -> Station:
    """Return the machine rigid in some directions, of drawing and truth alike.

    They are drawn among the joints of all stages but those on the floor; a stage keeps two thirds
    of its joints.
    """
    random = stream(seed, "basis.rigid")
    stages = list(basis.stages)
    gone: dict[int, int] = {}
    places = [(i, joint.name) for i, stage in enumerate(stages) for joint in stage.joints]
    for number in random.permutation(len(places)).tolist():
        index, name = places[number]
        joints = basis.stages[index].joints
        if sum(gone.values()) == count:
            break
        if stages[index].parent == GROUND or 3 * (gone.get(index, 0) + 1) > len(joints):
            continue
        gone[index] = gone.get(index, 0) + 1
        left = tuple(joint for joint in stages[index].joints if joint.name != name)
        stages[index] = replace(stages[index], joints=left)
    return replace(basis, stages=tuple(stages))


def draw_mistuned(basis: Station, seed: int) -> Station:
    """Return a true machine whose stiffness and damping alone are off, twice as far as usual.

    The drawing is drawn as ever, so that it does not tell: factors on the true machine, of the
    square root of three times the usual spread, make up the rest.
    """
    rest = float(np.sqrt(3.0))
    return _with_joint_factors(
        basis,
        stiffness=(rest * DRAWN_STIFFNESS, stream(seed, "mistuned.stiffness")),
        damping=(rest * DRAWN_DAMPING, stream(seed, "mistuned.damping")),
    )


def draw_as_drawn(nominal: Station, seed: int, *, mistuned: bool = False) -> Station:
    """Return a true machine about one whose drawing stays: its springs and dampers are off.

    Args:
        nominal: the user's own model.
        seed: of the machine.
        mistuned: stiffness and damping are twice as far off as usual.
    """
    times = 2.0 if mistuned else 1.0
    spread = (times * DRAWN_STIFFNESS, times * DRAWN_DAMPING)
    varied = _with_joint_factors(
        nominal,
        stiffness=(spread[0], stream(seed, "as_drawn.stiffness")),
        damping=(spread[1], stream(seed, "as_drawn.damping")),
    )
    random = stream(seed, "as_drawn.tendon")
    tendons = []
    for tendon in nominal.tendons:
        stiffness, damping = np.exp(np.array(spread) * random.standard_normal(2)).tolist()
        tendons.append(
            replace(
                tendon, stiffness=tendon.stiffness * stiffness, damping=tendon.damping * damping
            )
        )
    return replace(varied, tendons=tuple(tendons))


def draw_drawing(basis: Station, seed: int) -> Station:
    """Return what the drawing says: the basis with stiffness and damping off by their factors."""
    return _with_joint_factors(
        basis,
        stiffness=(DRAWN_STIFFNESS, stream(seed, "drawing.stiffness")),
        damping=(DRAWN_DAMPING, stream(seed, "drawing.damping")),
    )


def draw_true(basis: Station, tolerance: Tolerances, seed: int) -> Station:
    """Return the true machine: the basis with masses, geometry and sensors off by tolerances."""
    body = stream(seed, "tolerance.body")
    joint = stream(seed, "tolerance.joint")
    sensor = stream(seed, "tolerance.sensor")
    instrument = stream(seed, "tolerance.instrument")
    stages = []
    for stage in basis.stages:
        shift = tolerance.joint_position * joint.standard_normal(3)
        joints = tuple(replace(drawn, position=drawn.position + shift) for drawn in stage.joints)
        sensors = tuple(
            _off_instrument(_off_sensor(drawn, tolerance, sensor), tolerance, instrument)
            for drawn in stage.sensors
        )
        stages.append(replace(_off_body(stage, tolerance, body), joints=joints, sensors=sensors))
    return replace(basis, stages=tuple(stages))


def draw_hammers(
    drawing: Station,
    node: int,
    tolerance: Tolerances,
    seed: int,
    purpose: str = "tolerance.hammer",
    instrument: str = "",
) -> tuple[Hammer, ...]:
    """Return the hits along a node's directions, each off by the hammer's tolerances on its own.

    Gain and delay of the force channel are those of the one hammer, wherever it hits.
    """
    stage, point = drawing.aim(node)
    random = stream(seed, purpose)
    gain, delay = _draw_force_channel(tolerance, seed, instrument)
    hammers = []
    for drawn in drawing.aim_axes(node):
        turn = Rotation.from_rotvec(tolerance.hammer_angle * random.standard_normal(3))
        position = point + tolerance.hammer_position * random.standard_normal(3)
        direction = turn.as_matrix() @ drawn
        hammers.append(Hammer(node, stage, position, direction, gain, delay, instrument=instrument))
    return tuple(hammers)


def draw_motor(motor: Motor, node: int, tolerance: Tolerances, seed: int) -> Hammer:
    """Return the force of a motor, with gain and delay of its own force channel.

    Args:
        motor: the motor.
        node: its number among hits.
        tolerance: of the force channel.
        seed: of the machine.
    """
    gain, delay = _draw_force_channel(tolerance, seed, motor.name)
    still = np.zeros(3), np.eye(3)[0]
    return Hammer(node, 0, *still, gain, delay, along=motor.along, instrument=motor.name)


def _draw_force_channel(tolerance: Tolerances, seed: int, instrument: str) -> tuple[float, float]:
    """Return gain and delay [s] of the force channel of an instrument."""
    purpose = f"tolerance.force.{instrument}" if instrument else "tolerance.force"
    channel = stream(seed, purpose).standard_normal(2)
    gain, delay = 1 + tolerance.hammer_gain * channel[0], tolerance.hammer_delay * channel[1]
    return float(gain), float(delay)


def _off_body(stage: StageBody, tolerance: Tolerances, random: np.random.Generator) -> StageBody:
    return replace(
        stage,
        mass=stage.mass * (1 + tolerance.mass * random.standard_normal()),
        com=stage.com + tolerance.com * random.standard_normal(3),
        inertia=_off_inertia(stage, tolerance.inertia, random),
    )


def _off_inertia(stage: StageBody, spread: float, random: np.random.Generator) -> Real:
    """Return the inertia with each of its six numbers off by a relative error of its own.

    A draw that no solid body can have is drawn again: flat stages lie near that border.
    """
    for _ in range(1000):
        upper = np.triu(1 + spread * random.standard_normal((3, 3)))
        inertia: Real = stage.inertia * (upper + np.triu(upper, 1).T)
        if is_inertia(inertia):
            return inertia
    raise TruthError(f"body {stage.name}: no inertia within {spread:g} of the drawn one is valid")


def _off_sensor(sensor: Sensor, tolerance: Tolerances, random: np.random.Generator) -> Sensor:
    turn = Rotation.from_rotvec(tolerance.sensor_angle * random.standard_normal(3))
    return replace(
        sensor,
        axes=sensor.axes @ turn.as_matrix().T,
        position=sensor.position + tolerance.sensor_position * random.standard_normal(3),
        gain=sensor.gain * (1 + tolerance.sensor_gain * random.standard_normal(3)),
    )


def _off_instrument(sensor: Sensor, tolerance: Tolerances, random: np.random.Generator) -> Sensor:
    numbers = random.standard_normal((2, 3))
    return replace(
        sensor,
        cross=tolerance.sensor_cross * numbers[0],
        delay=tolerance.sensor_delay * numbers[1],
    )


def _with_joint_factors(
    station: Station,
    *,
    stiffness: tuple[float, np.random.Generator],
    damping: tuple[float, np.random.Generator],
) -> Station:
    """Multiply each joint's stiffness and damping by exp(N(0, spread))."""

    def factor(spread: float, random: np.random.Generator) -> float:
        return float(np.exp(spread * random.standard_normal()))

    def vary(joint: Joint) -> Joint:
        return replace(
            joint,
            stiffness=joint.stiffness * factor(*stiffness),
            damping=joint.damping * factor(*damping),
        )

    return station.vary_joints(vary)
