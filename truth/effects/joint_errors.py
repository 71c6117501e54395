"""Joints that are drawn wrong: springs that meet elsewhere, mass across it, a soft direction."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from truth.effects.effect import Answer, Scene, Sized, Vector
from truth.effects.places import (
    DIRECTIONS,
    AtDirection,
    choose,
    draw_direction,
    draw_stage,
    joint_stretch,
    log_uniform,
    springs,
    unit_vector,
)
from truth.machine.rig import Occasion, Prepared, Rig
from truth.machine.station import GROUND, Joint, Real, StageBody, Station

COUPLING_OFFSET = (0.01, 0.12)


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
    limits = (1e-4, 0.3)  # m

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
        size=random.uniform(*COUPLING_OFFSET),
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


INERTANCE_RATIO = (0.1, 0.6)


@dataclass(frozen=True)
class Inertance(AtDirection):
    """A force b times the relative acceleration along one joint direction: M gains b g g^T.

    Args:
        size: b over the body's mass (slide) or its moment of inertia about the axis (hinge).
        direction: of the joint, g its row.
        reference: that mass [kg] or moment [kg m2].
    """

    reference: float
    effect = "inertance"
    limits = (1e-3, 5.0)

    def parameters(self) -> dict[str, float]:
        """Return b [kg] or [kg m2]."""
        return {"inertance": self.size * self.reference}

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the inertance."""
        row = self.direction.stretch(rig, tested)
        return rig.with_matrices(mass=self.size * self.reference * np.outer(row, row))


def draw_inertance(
    random: np.random.Generator, scene: Scene, place: str | None
) -> Inertance | None:
    """Draw a joint direction between two bodies and the inertance.

    Along the only direction of a body on the floor it is a mass, which is another effect.
    """
    stages = scene.station.stages
    floor = {joint.name for stage in stages if stage.parent == GROUND for joint in stage.joints}

    def between(joint: Joint) -> bool:
        return joint.name not in floor

    direction = draw_direction(random, scene.station, place, between)
    if direction is None:
        return None
    stage = scene.station.stages[scene.station.index(direction.stage)]
    joint = direction.joint(scene.station)
    moment = float(joint.axis @ stage.inertia @ joint.axis)
    return Inertance(
        direction=direction,
        reference=stage.mass if joint.kind == "slide" else moment,
        size=log_uniform(random, INERTANCE_RATIO),
    )


COMPLIANCE_SIZE = (1.0, 30.0)
RIGID_RATIO = 10.0  # times the stiffest spring of the kind: the stiffness at size 1


@dataclass(frozen=True)
class MissingDof(Sized):
    """A spring and a damper along one world axis through the joint's point.

    The stiffness is ``reference / size``: as the size falls, the direction becomes rigid. The
    reference is 10 times the stiffest spring of the same kind in the stage's joint, or in the next
    joint down the tree that has one; the damper has the median time constant c/k of that joint.

    Args:
        size: compliance over the reference's.
        stage: name of the child body.
        dof: such as ``rx``.
        reference: [N/m] or [N m/rad].
        time_constant: c/k [s].
    """

    stage: str
    dof: str
    reference: float
    time_constant: float
    limits = (1e-3, 100.0)

    @property
    def stiffness(self) -> float:
        """Return k [N/m] or [N m/rad]."""
        return self.reference / self.size

    def answer(self) -> Answer:
        """Return what is to be found."""
        damping = self.stiffness * self.time_constant
        parameters = {"stiffness": self.stiffness, "damping": damping}
        return Answer("missing_dof", f"joint:{self.stage}", self.dof, parameters)

    def to_machine(self, tested: Prepared, occasion: Occasion) -> Prepared:
        """Return the machine with one joint more."""
        index = tested.station.index(self.stage)
        stage = tested.station.stages[index]
        joint = Joint(
            name=f"{self.stage}_{self.dof}",
            kind="slide" if self.dof[0] == "t" else "hinge",
            axis=np.eye(3)["xyz".index(self.dof[1])],
            position=_point(stage),
            stiffness=self.stiffness,
            damping=self.stiffness * self.time_constant,
        )
        return tested.with_stage(index, replace(stage, joints=(*stage.joints, joint)))


def draw_missing_dof(
    random: np.random.Generator, scene: Scene, place: str | None
) -> MissingDof | None:
    """Draw a rigid direction along a world axis; None if every stage has six."""
    station = scene.station
    free = [list(_candidates(station, index)) for index in range(len(station.stages))]
    choices = [index for index, candidates in enumerate(free) if candidates]
    index = draw_stage(random, station, place, "joint", choices)
    if index is None:
        return None
    dof, reference, time_constant = choose(random, free[index])
    return MissingDof(
        stage=station.stages[index].name,
        dof=dof,
        reference=reference,
        time_constant=time_constant,
        size=log_uniform(random, COMPLIANCE_SIZE),
    )


def _candidates(station: Station, index: int) -> Iterator[tuple[str, float, float]]:
    """Go through the rigid directions of a stage, with reference stiffness and time constant."""
    stage = station.stages[index]
    twists = [_twist(joint, _point(stage)) for joint in stage.joints]
    taken = [joint.name for joint in stage.joints]
    for dof, twist in zip(DIRECTIONS, np.eye(6), strict=True):
        reference = _reference(station, index, "slide" if dof[0] == "t" else "hinge")
        independent = np.linalg.matrix_rank([*twists, twist], tol=1e-6) > len(twists)
        if reference and independent and f"{stage.name}_{dof}" not in taken:
            yield dof, *reference


def _reference(station: Station, index: int, kind: str) -> tuple[float, float] | None:
    at = index
    while at != GROUND:
        joints = [joint for joint in station.stages[at].joints if joint.stiffness > 0]
        alike = [joint.stiffness for joint in joints if joint.kind == kind]
        if alike:
            constants = [joint.damping / joint.stiffness for joint in joints]
            return RIGID_RATIO * max(alike), float(np.median(constants))
        at = station.stages[at].parent
    return None


def _point(stage: StageBody) -> Real:
    return stage.joints[0].position if stage.joints else stage.com


def _twist(joint: Joint, point: Real) -> Real:
    """Return the motion at a point per joint coordinate, translation and rotation; (6,)."""
    if joint.kind == "slide":
        return np.concatenate([joint.axis, np.zeros(3)])
    return np.concatenate([np.cross(joint.axis, point - joint.position), joint.axis])
