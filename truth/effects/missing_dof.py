"""A direction that the drawing holds for rigid gives way."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import DIRECTIONS, choose, draw_stage, log_uniform
from truth.machine.rig import Occasion, Prepared
from truth.machine.station import GROUND, Joint, Real, StageBody, Station

SIZE = (1.0, 30.0)
LIMITS = (1e-3, 100.0)
REFERENCE = 10.0  # times the stiffest spring of the kind: the stiffness at size 1


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
    limits = LIMITS

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
        size=log_uniform(random, SIZE),
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
            return REFERENCE * max(alike), float(np.median(constants))
        at = station.stages[at].parent
    return None


def _point(stage: StageBody) -> Real:
    return stage.joints[0].position if stage.joints else stage.com


def _twist(joint: Joint, point: Real) -> Real:
    """Return the motion at a point per joint coordinate, translation and rotation; (6,)."""
    if joint.kind == "slide":
        return np.concatenate([joint.axis, np.zeros(3)])
    return np.concatenate([np.cross(joint.axis, point - joint.position), joint.axis])
