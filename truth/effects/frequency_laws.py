"""Joints whose stiffness depends on frequency: structural losses, rubber, grease, glue."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import (
    choose,
    direction_of,
    draw_spring_stage,
    has_spring,
    joint_stretch,
    log_uniform,
    springs,
)
from truth.machine.rig import FrequencyLaw, Occasion, Prepared, Response, Rig
from truth.machine.station import Complex, Joint

LOSS = (0.03, 0.2)
GONE = 0.05  # loss factor from which the viscous damping is down to its share
RATIO = (0.1, 0.8)
CORNER_HZ = (10.0, 150.0)


@dataclass(frozen=True, kw_only=True)
class DynamicSprings(Sized):
    """A law beside each spring of a joint.

    Args:
        stage: name of the child body.
    """

    stage: str

    def stiffness_of(self, joint: Joint) -> Response | None:
        """Return the dynamic stiffness z(s) beside a spring; None for none."""
        raise NotImplementedError

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with one law for each joint direction that has one."""
        index = tested.station.index(self.stage)
        joints, rows = tested.station.stages[index].joints, joint_stretch(rig, tested, index)
        laws = tuple(
            FrequencyLaw(row, row, stiffness)
            for joint, row in zip(joints, rows, strict=True)
            if (stiffness := self.stiffness_of(joint)) is not None
        )
        return replace(rig, laws=(*rig.laws, *laws))


@dataclass(frozen=True, kw_only=True)
class StructuralDamping(DynamicSprings):
    r"""Every spring of a joint becomes k (1 + i eta), its damper keeps a part of itself.

        z(s) = i k eta sign(Im s),   c' = c (1 - (1 - share) min(1, eta / 0.05))

    so that with the loss factor the whole effect vanishes. A spring's loss is the same at each
    frequency; the force is not causal in time, as always with this textbook law.

    Args:
        size: loss factor eta.
        share: of the viscous damping that stays once eta is 0.05 or more.
    """

    share: float
    limits = (1e-4, 0.6)

    def __post_init__(self) -> None:
        """Check that no damper becomes negative."""
        super().__post_init__()
        self.require(0 <= self.share <= 1)

    def answer(self) -> Answer:
        """Return what is to be found."""
        parameters = {"loss_factor": self.size}
        return Answer("structural_damping", location=f"joint:{self.stage}", parameters=parameters)

    def stiffness_of(self, joint: Joint) -> Response | None:
        """Return i k eta, at positive frequencies; None without a spring."""
        return partial(_loss, joint.stiffness * self.size) if has_spring(joint) else None

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the losses, and with less viscous damping."""
        index = tested.station.index(self.stage)
        joints, rows = tested.station.stages[index].joints, joint_stretch(rig, tested, index)
        gone = (1 - self.share) * min(1.0, self.size / GONE)
        less = springs(rows, [-gone * joint.damping for joint in joints])
        return super().to_rig(rig.with_matrices(damping=less), tested, occasion)


def _loss(loss: float, s: Complex) -> Complex:
    return 1j * loss * np.sign(s.imag)


@dataclass(frozen=True, kw_only=True)
class Viscoelastic(DynamicSprings):
    r"""A spring and a damper in series (Maxwell) beside one spring k of a joint, or all alike.

        z(s) = k r s tau / (1 + s tau)

    It is not felt slowly and adds r k at high frequency; its loss is largest at 1/(2 pi tau).

    Args:
        size: r, stiffness of the branch over the static stiffness.
        tau: [s].
        dof: direction of the one spring, such as ``tz``; empty: all springs.
    """

    tau: float
    dof: str = ""
    # A branch of ten times the joint's stiffness is another joint: stiffness and damping that are
    # tuned take all of it, whatever a refit that is linear about the true machine says.
    limits = (1e-3, 2.0)

    def __post_init__(self) -> None:
        """Check that the branch can exist."""
        super().__post_init__()
        self.require(0 < self.tau < np.inf)

    def answer(self) -> Answer:
        """Return what is to be found."""
        parameters = {"ratio": self.size, "tau": self.tau}
        place = f"joint:{self.stage}"
        return Answer("viscoelastic", location=place, dof=self.dof, parameters=parameters)

    def stiffness_of(self, joint: Joint) -> Response | None:
        """Return the branch; None for a joint direction without a spring, or another one."""
        if not has_spring(joint) or self.dof not in ("", direction_of(joint)):
            return None
        return partial(_branch, joint.stiffness * self.size, self.tau)


def _branch(stiffness: float, tau: float, s: Complex) -> Complex:
    return stiffness * s * tau / (1 + s * tau)


def draw_structural_damping(
    random: np.random.Generator, scene: Scene, place: str | None
) -> StructuralDamping | None:
    """Draw joint, loss factor and what remains of the viscous damping."""
    stage = draw_spring_stage(random, scene.station, place)
    if stage is None:
        return None
    return StructuralDamping(stage=stage, share=random.uniform(0, 1), size=random.uniform(*LOSS))


def draw_viscoelastic(
    random: np.random.Generator, scene: Scene, place: str | None
) -> Viscoelastic | None:
    """Draw joint, ratio, time constant, and one of the springs or all of them."""
    stage = draw_spring_stage(random, scene.station, place)
    if stage is None:
        return None
    corner = log_uniform(random, CORNER_HZ)
    size = log_uniform(random, RATIO)
    joints = scene.station.stages[scene.station.index(stage)].joints
    directions = [direction_of(joint) for joint in joints if has_spring(joint)]
    dof = choose(random, directions) if random.integers(2) else ""
    return Viscoelastic(stage=stage, tau=1 / (2 * np.pi * corner), size=size, dof=dof)
