"""A joint whose springs meet elsewhere than drawn: its directions are coupled."""

from dataclasses import dataclass, replace

import numpy as np

from truth.effects.effect import Answer, Scene, Vector
from truth.effects.places import draw_stage, joint_stretch, springs, unit_vector
from truth.machine.rig import Occasion, Prepared, Rig
from truth.machine.station import Real, StageBody

OFFSET = (0.01, 0.12)
LIMITS = (1e-4, 0.3)  # m


@dataclass(frozen=True)
class JointCoupling(Vector):
    r"""The centre of stiffness of a joint is off by o; its dampers sit there too.

    Rigid directions stay. Springs and dampers feel the relative motion at the displaced point. With
    joint coordinates q through the drawn point, axes a of the slides and relative rotation theta,

        q'_slide = q_slide + a . (theta x o),   q'_hinge = q_hinge
        K gains sum_joints k (g' g'^T - g g^T),   q = g x

    so that a slide's stiffness k couples with the hinge about b by k o . (a x b); C likewise.

    Args:
        size: |o| [m].
        stage: name of the child body.
    """

    stage: str
    limits = LIMITS

    def answer(self) -> Answer:
        """Return what is to be found."""
        parameters = {"offset": self.vector}
        return Answer("joint_coupling", location=f"joint:{self.stage}", parameters=parameters)

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the joint's springs and dampers elsewhere."""
        index = tested.station.index(self.stage)
        joints = tested.station.stages[index].joints
        displaced = _displace_joints(tested, index, np.array(self.vector))
        before, after = (joint_stretch(rig, machine, index) for machine in (tested, displaced))
        stiffness = [joint.stiffness for joint in joints]
        damping = [joint.damping for joint in joints]
        return rig.with_matrices(
            stiffness=springs(after, stiffness) - springs(before, stiffness),
            damping=springs(after, damping) - springs(before, damping),
        )


def _displace_joints(tested: Prepared, index: int, offset: Real) -> Prepared:
    stage = tested.station.stages[index]
    joints = tuple(replace(joint, position=joint.position + offset) for joint in stage.joints)
    return tested.with_stage(index, replace(stage, joints=joints))


def draw_joint_coupling(
    random: np.random.Generator, scene: Scene, place: str | None
) -> JointCoupling | None:
    """Draw a joint that can couple, and an offset that is felt."""
    stages = scene.station.stages
    felt = [_felt(stage) for stage in stages]
    choices = [index for index, span in enumerate(felt) if span.any()]
    index = draw_stage(random, scene.station, place, "joint", choices)
    if index is None:
        return None
    return JointCoupling(
        stage=stages[index].name,
        along=unit_vector(random, felt[index]),
        size=random.uniform(*OFFSET),
    )


def _felt(stage: StageBody) -> Real:
    """Return the directions a x b of offsets that couple a slide's spring to a hinge; (n, 3)."""
    directions = [
        np.cross(slide.axis, hinge.axis)
        for slide in stage.joints
        for hinge in stage.joints
        if slide.kind == "slide" and hinge.kind == "hinge" and slide.stiffness > 0
    ]
    return np.array(directions).reshape(-1, 3)
