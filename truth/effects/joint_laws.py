"""Joints whose force is no multiple of the stretch: friction, play, a spring that stiffens.

How far a joint moves under a hit, before anything nonlinear is in it.
"""

from dataclasses import dataclass, replace

import numpy as np

from truth.effects.effect import Scene
from truth.effects.places import AtDirection, StageDirection, draw_direction, log_uniform
from truth.errors import NoPlaceError
from truth.machine.rig import (
    Memoryless,
    NonlinearJoint,
    Occasion,
    Prepared,
    Restoring,
    Rig,
    build,
    receptance,
)
from truth.machine.station import Hammer, Real

GAP_SHARE = (0.01, 0.3)
STUCK_RATIO, SLIP_SHARE = (0.05, 0.5), (0.05, 0.6)
CUBIC_RATIO = (0.05, 1.0)


@dataclass(frozen=True, kw_only=True)
class JointLaw(AtDirection):
    """A nonlinear force beside a joint's spring.

    Args:
        spring: the joint's stiffness k [N/m or N m/rad].
    """

    spring: float

    def law(self) -> Restoring:
        """Return the force beside the linear ones."""
        raise NotImplementedError

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the force in its joint."""
        joint = NonlinearJoint(self.direction.stretch(rig, tested), self.law())
        return replace(rig, joints=(*rig.joints, joint))


@dataclass(frozen=True)
class Play(Memoryless):
    """The rest -k clip(x, gap) of a spring k: what it lacks within the gap.

    Args:
        stiffness: k [N/m].
        gap: to either side [m].
    """

    stiffness: float
    gap: float

    def force(self, stretch: Real, state: Real) -> tuple[Real, Real]:
        """Return -k clip(x, gap)."""
        return -self.stiffness * np.minimum(np.maximum(stretch, -self.gap), self.gap), state


@dataclass(frozen=True, kw_only=True)
class Backlash(JointLaw):
    r"""A dead zone of a joint's spring: force k (x - gap) beyond +gap, k (x + gap) beyond -gap.

    The damper acts all the time; the joint rests in the middle of its gap. It cannot vanish from
    the end of a decaying motion: however small the gap, what is smaller still finds no spring.

    Args:
        peak: stretch under a usual hit, of the linear machine [m or rad].
        size: gap over that.
    """

    peak: float
    effect = "backlash"
    limits = (1e-5, 1.0)

    @property
    def gap(self) -> float:
        """To either side [m or rad]."""
        return self.size * self.peak

    def parameters(self) -> dict[str, float]:
        """Return the gap to either side [m or rad]."""
        return {"gap": self.gap}

    def law(self) -> Play:
        """Return what the spring lacks within the gap."""
        return Play(self.spring, self.gap)


@dataclass(frozen=True)
class Jenkins(Memoryless):
    """The rest -k y of k (x - y), |k (x - y)| <= limit: y, the slip, follows when that is reached.

    Args:
        stiffness: k [N/m].
        limit: [N].
    """

    stiffness: float
    limit: float

    def force(self, stretch: Real, state: Real) -> tuple[Real, Real]:
        """Return -k y and y, the state, which is 0 at rest."""
        reach = self.limit / self.stiffness
        slip = stretch - np.minimum(np.maximum(stretch - state, -reach), reach)
        return -self.stiffness * slip, slip


@dataclass(frozen=True, kw_only=True)
class Friction(JointLaw):
    r"""Dry friction: a Jenkins element in parallel to a joint's spring.

    Its force is k (x - y) while that is within its limit; beyond, y slides along (Jenkins 1962).
    At small motion it is the spring k, which belongs to the linear machine.

    Args:
        size: k over the joint's own stiffness.
        limit: [N or N m].
    """

    limit: float
    effect = "friction"
    limits = (1e-3, 5.0)

    def parameters(self) -> dict[str, float]:
        """Return k and the limit."""
        return {"k": self.size * self.spring, "limit": self.limit}

    def law(self) -> Jenkins:
        """Return what slides beside the stuck spring."""
        return Jenkins(self.size * self.spring, self.limit)

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the stuck spring, and what slides beside it."""
        row = self.direction.stretch(rig, tested)
        stuck = rig.with_matrices(stiffness=self.size * self.spring * np.outer(row, row))
        return super().to_rig(stuck, tested, occasion)


@dataclass(frozen=True)
class Cubic(Memoryless):
    """The rest k3 x^3, k3 [N/m^3]."""

    stiffness: float

    def force(self, stretch: Real, state: Real) -> tuple[Real, Real]:
        """Return k3 x^3."""
        return self.stiffness * stretch**3, state


@dataclass(frozen=True, kw_only=True)
class Hardening(JointLaw):
    """A cubic spring (Duffing 1918) beside a joint's linear one: k x + k3 x^3.

    Args:
        peak: stretch under a usual hit, of the linear machine [m or rad].
        size: k3 peak^2 / k, how much stiffer the spring is there.
    """

    peak: float
    effect = "hardening"
    limits = (1e-4, 10.0)

    @property
    def cubic(self) -> float:
        """k3 [N/m^3 or N m/rad^3]."""
        return self.size * self.spring / self.peak**2

    def parameters(self) -> dict[str, float]:
        """Return k3."""
        return {"k3": self.cubic}

    def law(self) -> Cubic:
        """Return the cubic spring."""
        return Cubic(self.cubic)


def draw_backlash(random: np.random.Generator, scene: Scene, place: str | None) -> Backlash | None:
    """Draw joint, direction and gap."""
    direction = draw_direction(random, scene.station, place)
    size = log_uniform(random, GAP_SHARE)
    if direction is None:
        return None
    spring, peak = direction.joint(scene.station).stiffness, peak_stretch(scene, direction)
    return Backlash(direction=direction, spring=spring, peak=peak, size=size)


def draw_friction(random: np.random.Generator, scene: Scene, place: str | None) -> Friction | None:
    """Draw joint, direction and limit: a part of the force that the stuck spring would carry."""
    direction = draw_direction(random, scene.station, place)
    size, share = log_uniform(random, STUCK_RATIO), log_uniform(random, SLIP_SHARE)
    if direction is None:
        return None
    spring = direction.joint(scene.station).stiffness
    limit = share * size * spring * peak_stretch(scene, direction)
    return Friction(direction=direction, spring=spring, size=size, limit=limit)


def draw_hardening(
    random: np.random.Generator, scene: Scene, place: str | None
) -> Hardening | None:
    """Draw joint, direction and how much stiffer it gets."""
    direction = draw_direction(random, scene.station, place)
    size = log_uniform(random, CUBIC_RATIO)
    if direction is None:
        return None
    spring, peak = direction.joint(scene.station).stiffness, peak_stretch(scene, direction)
    return Hardening(direction=direction, spring=spring, peak=peak, size=size)


_SPACING_HZ, _HIGHEST_HZ = 1.0, 400.0
_PULSE_SECONDS = 5.7e-3  # of a usual hit


def peak_stretch(scene: Scene, direction: StageDirection) -> float:
    """Return the largest stretch that a hit of the middle level makes in a joint [m or rad].

    A half sine of peak A and duration T has the momentum 2 A T / pi; the linear machine's answer
    is the inverse transform of its receptance times the spectrum of such a hit.

    Raises:
        NoPlaceError: motors alone drive the test.
    """
    levels = sorted(occasion.level for occasion in scene.occasions)
    level = levels[len(levels) // 2]
    nodes = sorted({occasion.node for occasion in scene.occasions if occasion.node >= 0})
    if not nodes:
        raise NoPlaceError("a test by motors has no hits, whose force would say how far joints go")
    aims = [(node, *scene.station.aim(node)) for node in nodes]
    hammers = tuple(
        Hammer(node, stage, point, axis)
        for node, stage, point in aims
        for axis in scene.station.aim_axes(node)
    )
    tested = Prepared(scene.station, hammers)
    rig = build(tested)
    spacing, pulse = _SPACING_HZ * scene.pace, _PULSE_SECONDS / scene.pace
    lines = scene.pace * np.arange(_SPACING_HZ, _HIGHEST_HZ, _SPACING_HZ)
    cycles = lines * pulse
    force = level * pulse / 2 * (np.sinc(cycles - 0.5) + np.sinc(cycles + 0.5))
    force = force * np.exp(-1j * np.pi * cycles)
    motion = direction.stretch(rig, tested) @ receptance(rig, lines, rig.drive)
    spectrum = np.vstack([np.zeros((1, motion.shape[1])), motion * force[:, None]])
    samples = np.fft.irfft(spectrum, axis=0) * 2 * (len(lines)) * spacing
    return float(np.abs(samples).max())
