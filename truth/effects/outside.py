"""Effects that the catalogue lacks: a diagnosis should say ``unexplained``, and where."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType

import numpy as np

from truth.effects.effect import Draw, Scene
from truth.effects.feedback_delay import largest_coupling
from truth.effects.joint_laws import JointLaw, peak_stretch
from truth.effects.places import (
    AtDirection,
    StageDirection,
    choose,
    direction_of,
    draw_direction,
    has_spring,
    log_uniform,
    sign,
)
from truth.machine.rig import FrequencyLaw, Memoryless, Occasion, Prepared, Rig, build
from truth.machine.station import Complex, Joint, Real

LOG_FACTOR = (0.1, 0.5)
STEPS = 4  # of the change, so that five machines arise


@dataclass(frozen=True)
class ChangingStiffness(AtDirection):
    """The stiffness of one joint direction is k exp(sign size t), t from 0 to 1 in each column.

    The time goes in quarters: five machines in all.

    Args:
        size: |log| of the stiffness at the end over that at the start.
        direction: of the joint.
        sign: +1 becomes stiffer, -1 softer.
    """

    sign: int
    effect = "unexplained"
    kind = "changing_stiffness"
    limits = (1e-3, 1.5)

    def parameters(self) -> dict[str, float]:
        """Return the stiffness at the end over that at the start."""
        return {"factor": float(np.exp(self.sign * self.size))}

    def when(self, occasion: Occasion) -> float:
        """Return the time, rounded to quarters."""
        return round(STEPS * occasion.time) / STEPS

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig at the occasion's time."""
        row = self.direction.stretch(rig, tested)
        stiffness = self.direction.joint(tested.station).stiffness
        more = stiffness * np.expm1(self.sign * self.size * self.when(occasion))
        return rig.with_matrices(stiffness=more * np.outer(row, row))


def draw_changing_stiffness(
    random: np.random.Generator, scene: Scene, place: str | None
) -> ChangingStiffness | None:
    """Draw a joint direction, and whether it becomes stiffer or softer."""
    direction = draw_direction(random, scene.station, place)
    if direction is None:
        return None
    return ChangingStiffness(
        direction=direction, sign=sign(random), size=random.uniform(*LOG_FACTOR)
    )


COUPLING_SHARE = (0.2, 0.7)  # of the largest size
COUPLING_SMALLEST = 1e-4  # of the largest size
COUPLING_LARGEST = 20.0


@dataclass(frozen=True)
class Crosstalk(AtDirection):
    r"""A force along one joint direction from the speed of another stage's: C gains d a b^T.

    C is unsymmetric then, and FRFs are not reciprocal. With the dampers c_a and c_b of the two
    directions, C's symmetric part stays positive semidefinite up to |d| = 2 sqrt(c_a c_b), and
    with it the machine stable. How much more it bears depends on the machine: four fifths of what
    makes a mode unstable (``largest_coupling``), and not more than 20 times the dampers.

    Args:
        size: |d| over sqrt(c_a c_b).
        direction: on which the force acts.
        source: whose speed is fed back.
        coupling: d at size 1, with its sign [N s/m], [N m s/rad] or between.
        largest: size that leaves the machine stable.
    """

    source: StageDirection
    coupling: float
    largest: float
    effect = "unexplained"
    kind = "crosstalk"

    @property
    def limits(self) -> tuple[float, float]:
        """Return smallest and largest size."""
        return COUPLING_SMALLEST * self.largest, self.largest

    def parameters(self) -> dict[str, float]:
        """Return d."""
        return {"coupling": self.size * self.coupling}

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the feedback."""
        acts, feels = self.direction.stretch(rig, tested), self.source.stretch(rig, tested)
        return rig.with_matrices(damping=self.size * self.coupling * np.outer(acts, feels))


def _has_damper(joint: Joint) -> bool:
    return joint.damping > 0


def draw_crosstalk(
    random: np.random.Generator, scene: Scene, place: str | None
) -> Crosstalk | None:
    """Draw two damped joint directions of two stages, and the sign of the coupling."""
    station = scene.station
    direction = draw_direction(random, station, place, _has_damper)
    if direction is None:
        return None
    sources = [
        StageDirection(stage.name, number, direction_of(joint))
        for stage in station.stages
        for number, joint in enumerate(stage.joints)
        if stage.name != direction.stage and _has_damper(joint)
    ]
    if not sources:
        return None
    source = choose(random, sources)
    dampers = direction.joint(station).damping, source.joint(station).damping
    coupling = sign(random) * float(np.sqrt(dampers[0] * dampers[1]))
    tested = Prepared(station, ())
    rig = build(tested)
    acts, feels = direction.stretch(rig, tested), source.stretch(rig, tested)
    largest = min(largest_coupling(rig, feels, coupling * acts), COUPLING_LARGEST)
    return Crosstalk(
        direction=direction,
        source=source,
        coupling=coupling,
        largest=largest,
        size=largest * random.uniform(*COUPLING_SHARE),
    )


DAMPER_RATIO = (0.1, 0.6)
DAMPER_ORDER = (0.3, 0.7)
DAMPER_HZ = 50.0


@dataclass(frozen=True)
class FractionalDamper(AtDirection):
    r"""A force c d^alpha x / dt^alpha along one joint direction: z(s) = c s^alpha, alpha < 1.

    The principal value of s^alpha has a positive real part on the right half plane: passive.

    Args:
        size: |z| at 50 Hz over the spring's stiffness.
        direction: of the joint.
        stiffness: of its spring.
        order: alpha.
    """

    stiffness: float
    order: float
    effect = "unexplained"
    kind = "fractional_damper"
    limits = (1e-3, 5.0)

    def __post_init__(self) -> None:
        """Check that it is between spring and damper."""
        super().__post_init__()
        self.require(0 < self.order < 1)

    @property
    def coefficient(self) -> float:
        """Return c [N s^alpha / m] or [N m s^alpha / rad]."""
        return float(self.size * self.stiffness / (2 * np.pi * DAMPER_HZ) ** self.order)

    def parameters(self) -> dict[str, float]:
        """Return c and alpha."""
        return {"coefficient": self.coefficient, "order": self.order}

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the damper."""
        row = self.direction.stretch(rig, tested)
        law = FrequencyLaw(row, row, partial(_power, self.coefficient, self.order))
        return replace(rig, laws=(*rig.laws, law))


def _power(coefficient: float, order: float, s: Complex) -> Complex:
    return np.asarray(coefficient * s**order)


def draw_fractional_damper(
    random: np.random.Generator, scene: Scene, place: str | None
) -> FractionalDamper | None:
    """Draw a joint direction, the order and the strength."""
    direction = draw_direction(random, scene.station, place)
    if direction is None:
        return None
    return FractionalDamper(
        direction=direction,
        stiffness=direction.joint(scene.station).stiffness,
        order=random.uniform(*DAMPER_ORDER),
        size=log_uniform(random, DAMPER_RATIO),
    )


EDGE_SHARE = (0.05, 0.4)


@dataclass(frozen=True)
class Rocking(Memoryless):
    """The rest -loss (x - clip(x, edge)): beyond the edge the support is so much softer.

    Args:
        loss: stiffness lost [N m/rad].
        edge: to either side [rad].
    """

    loss: float
    edge: float

    def force(self, stretch: Real, state: Real) -> tuple[Real, Real]:
        """Return the moment that is lost."""
        return -self.loss * (
            stretch - np.minimum(np.maximum(stretch, -self.edge), self.edge)
        ), state


@dataclass(frozen=True, kw_only=True)
class RockingContact(JointLaw):
    """A tilting stiffness that falls from k to (1 - size) k beyond an angle.

    Args:
        edge: angle at which a part of the contact lifts [rad].
        size: part of the stiffness that is lost.
    """

    edge: float
    limits = (1e-3, 0.95)
    effect = "unexplained"
    kind = "rocking_contact"

    def parameters(self) -> dict[str, float]:
        """Return the angle [rad] and the part of the stiffness that is lost beyond."""
        return {"edge": self.edge, "lost": self.size}

    def law(self) -> Rocking:
        """Return the moment that is lost beyond the edge."""
        return Rocking(self.size * self.spring, self.edge)


def draw_rocking_contact(
    random: np.random.Generator, scene: Scene, place: str | None
) -> RockingContact | None:
    """Draw joint, direction, angle and what is lost."""

    def tilts(joint: Joint) -> bool:
        return joint.kind == "hinge" and has_spring(joint) and abs(joint.axis[2]) < 0.5

    direction = draw_direction(random, scene.station, place, tilts)
    share, size = log_uniform(random, EDGE_SHARE), random.uniform(0.1, 0.8)
    if direction is None:
        return None
    spring = direction.joint(scene.station).stiffness
    edge = share * peak_stretch(scene, direction)
    return RockingContact(direction=direction, spring=spring, edge=edge, size=size)


OUTSIDE: Mapping[str, Draw] = MappingProxyType(
    {
        "fractional_damper": draw_fractional_damper,
        "changing_stiffness": draw_changing_stiffness,
        "crosstalk": draw_crosstalk,
        "rocking_contact": draw_rocking_contact,
    }
)
