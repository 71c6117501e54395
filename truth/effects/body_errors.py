"""Bodies that carry what the drawing forgets: a payload, a loose cover on a spring, a rotor."""

from dataclasses import dataclass, replace

import numpy as np

from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import body_motion, choose, draw_stage
from truth.machine.rig import Occasion, Prepared, Rig
from truth.machine.station import AXES, GROUND, Real, StageBody, Station

MASS_RATIO = (0.05, 0.25)
MASS_EXTENT = (0.3, 1.5)  # of the radius of gyration: bounds of the extent of a body's sensors


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
    limits = (1e-3, 1.0)  # of the body's mass

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
    away = np.abs(stage.measured_places - stage.com)
    reach = np.clip(np.max([np.zeros(3), *away], axis=0), *(np.array(MASS_EXTENT) * gyration))
    position = reach * random.uniform(-1, 1, 3)
    return MassError(
        body=stage.name,
        body_mass=stage.mass,
        position=tuple(position.tolist()),
        size=random.uniform(*MASS_RATIO),
    )


APPENDAGE_RATIO = (0.03, 0.10)
APPENDAGE_HZ = (30.0, 150.0)
APPENDAGE_DAMPING = (0.01, 0.03)
# Shares of the mass across the axis and counted in the body: of boxes, then of cables.
APPENDAGE_KINDS = ((1.0, 0.0), (1.0, 1.0), (0.0, 0.0), (0.0, 0.0))


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
    limits = (1e-4, 0.5)  # of the body's mass

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
    across, counted = APPENDAGE_KINDS[kinds.integers(len(APPENDAGE_KINDS))]
    return Appendage(
        body=stage.name,
        body_mass=stage.mass,
        axis=int(random.integers(3)),
        size=random.uniform(*APPENDAGE_RATIO),
        frequency=scene.pace * random.uniform(*APPENDAGE_HZ),
        damping=random.uniform(*APPENDAGE_DAMPING),
        across=across,
        counted=counted,
    )


ROTOR_SPEED = (30.0, 300.0)
ALL_DIRECTIONS = 6


@dataclass(frozen=True)
class Gyroscopic(Sized):
    r"""Angular momentum h along an axis e that turns with the body.

    At a small rotation theta the rotor's axis is e + theta x e, so that the body's angular
    momentum about its centre of mass is L = I theta' + h (e + theta x e), to first order. What
    turns it is its rate:

        tau = dL/dt = I theta'' + h theta' x e = I theta'' - h [e]x theta',   [e]x v = e x v

    which adds -h [e]x to the damping of theta: skew, so that no energy is lost. For e = z the
    moment about x is I_x theta_x'' + h theta_y'; FRFs stop being reciprocal.

    Args:
        size: h over the body's mean moment of inertia [rad/s].
        body: name of the body.
        moment: its mean moment of inertia [kg m2].
        axis: e, unit vector, world axes.
    """

    body: str
    moment: float
    axis: tuple[float, ...]
    limits = (0.1, 1000.0)  # rad/s

    @property
    def angular_momentum(self) -> float:
        """Return h [kg m2/s]."""
        return self.size * self.moment

    def answer(self) -> Answer:
        """Return what is to be found."""
        parameters = {"angular_momentum": self.angular_momentum}
        return Answer("gyroscopic", location=f"body:{self.body}", parameters=parameters)

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the rotor's torques."""
        damping = np.zeros_like(rig.equations.damping)
        start = 6 * tested.station.index(self.body) + 3
        turning = slice(start, start + 3)
        # Column j of [e]x is e x (unit vector j).
        damping[turning, turning] = -self.angular_momentum * np.cross(self.axis, np.eye(3)).T
        return rig.with_matrices(damping=damping)


def draw_gyroscopic(
    random: np.random.Generator, scene: Scene, place: str | None
) -> Gyroscopic | None:
    """Draw a body that can tilt its rotor, the rotor's axis among its hinges', and h."""
    station = scene.station
    axes = [_axes(station, index) for index in range(len(station.stages))]
    choices = [index for index, some in enumerate(axes) if some]
    index = draw_stage(random, station, place, "body", choices)
    if index is None:
        return None
    stage = station.stages[index]
    axis: tuple[float, ...] = tuple(choose(random, axes[index]).tolist())
    return Gyroscopic(
        body=stage.name,
        moment=float(np.trace(stage.inertia)) / 3,
        axis=axis,
        size=random.uniform(*ROTOR_SPEED),
    )


def _axes(station: Station, index: int) -> list[Real]:
    """Return the axes of a rotor that the body, on its parents, can turn about two others.

    With less there is no effect: h theta' x e does no work on a rotation about one axis alone. A
    body with six joints, or whose last hinge is about z, or with no hinge, spins about z.
    """
    stage = station.stages[index]
    hinges = [joint.axis for joint in stage.joints if joint.kind == "hinge"]
    z = np.eye(3)[2]
    if not hinges or len(stage.joints) == ALL_DIRECTIONS or abs(hinges[-1] @ z) > 1 - 1e-9:
        candidates = [z]
    else:
        candidates = hinges
    turns, at = [], index
    while at != GROUND:
        turns += [joint.axis for joint in station.stages[at].joints if joint.kind == "hinge"]
        at = station.stages[at].parent
    if not turns:
        return []
    return [e for e in candidates if np.linalg.matrix_rank(np.cross(turns, e), tol=1e-6) > 1]
