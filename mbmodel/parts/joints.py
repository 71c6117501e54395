"""Parts for the position of a stage's joints and the direction of their axes."""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby

import numpy as np

from identification.words import Real
from mbmodel.linearisation.drawing import DrawnElement
from mbmodel.machine import Axle, Machine
from mbmodel.mjcf.edit import Addition, Edit, NotInMjcf
from mbmodel.parts.part import AXIS_NAMES, Change, Parameter, PartContext, ToleranceKind
from mbmodel.spatial import cross_matrix, rotation_matrix, rotation_slopes, twist


@dataclass(frozen=True, eq=False)
class JointPart:
    """The slides and hinges of one stage, displaced and turned as one frame.

    A coordinate moves all bodies above it by the twist of its axis: (a, 0) of a slide,
    (p x a, a) of a hinge through p. With a displacement d of the joints and their rotation
    ``R = exp([r]x)``, each about its own anchor, the twist is (R a, 0) or ((p + d) x R a, R a). T
    changes by the difference, at one pose at rest (see ``mbmodel.moving_equilibrium``).

    Args:
        stage: name of the body that the joints carry.
        axles: its slides and hinges.
        drawn_joints: those that are in the MJCF; released rigid directions are not.
        motion_per_twist: motion of every body above per twist at ``origin``; (6 n_body, 6).
        origin: reference point of the twists [m]; (3,).
        n_coordinate: number of joint coordinates of the machine.
    """

    stage: str
    axles: tuple[Axle, ...]
    drawn_joints: tuple[DrawnElement, ...]
    motion_per_twist: Real
    origin: Real
    n_coordinate: int

    @property
    def location(self) -> str:
        """Place in the machine, ``joint:<child body>``."""
        return f"joint:{self.stage}"

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Displacement (if any joint turns) and rotation vector, in world axes."""
        kinds: list[tuple[str, str, ToleranceKind]] = [("rotation", "rad", "exactly")]
        if any(axle.turns for axle in self.axles):
            kinds = [("position", "m", "joint_position"), *kinds]
        return tuple(
            Parameter(f"{self.stage}.joint_{kind}_{axis}", 0.0, unit, positive=False, known=known)
            for kind, unit, known in kinds
            for axis in AXIS_NAMES
        )

    def _displacement_and_rotation(self, theta: Real) -> tuple[Real, Real]:
        """Return displacement d [m] and rotation vector r [rad]; (3,) each."""
        return (theta[:3], theta[3:]) if len(theta) == 6 else (np.zeros(3), theta)

    @cached_property
    def _select(self) -> Real:
        """Columns of the stage's coordinates; (nv, n_axle)."""
        return np.eye(self.n_coordinate)[:, [axle.coordinate for axle in self.axles]]

    def changes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the twists at theta minus those of the drawing."""
        del context
        offset, rotation = self._displacement_and_rotation(theta)
        turn = rotation_matrix(rotation)
        core = np.zeros((3, 6, len(self.axles)))
        for k, axle in enumerate(self.axles):
            arm = axle.anchor - self.origin
            core[0, :, k] = twist(axle.turns, arm + offset, turn @ axle.axis)
            core[0, :, k] -= twist(axle.turns, arm, axle.axis)
        return (Change("path", self.motion_per_twist, self._select, core),)

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the derivatives of the twists."""
        del context
        offset, rotation = self._displacement_and_rotation(theta)
        turn, turns = rotation_matrix(rotation), rotation_slopes(rotation)
        count = len(self.parameters)
        core = np.zeros((count, 3, 6, len(self.axles)))
        for k, axle in enumerate(self.axles):
            arm, axis = axle.anchor - self.origin + offset, turn @ axle.axis
            for i in range(3):
                slope = turns[i] @ axle.axis
                core[count - 3 + i, 0, :, k] = twist(axle.turns, arm, slope)
                if count == 6 and axle.turns:
                    core[i, 0, :3, k] = cross_matrix(np.eye(3)[i]) @ axis
        return (Change("path", self.motion_per_twist, self._select, core),)

    def write(self, theta: Real) -> tuple[Edit | NotInMjcf, ...]:
        """Return position and axis of every joint, or nothing if they are as drawn.

        If all drawn joints are slides, the displacement belongs to released hinges and is not
        written here.
        """
        offset, rotation = self._displacement_and_rotation(theta)
        drawn = {joint.name for joint in self.drawn_joints}
        if not any(axle.turns and axle.joint in drawn for axle in self.axles):
            offset = np.zeros(3)
        if not offset.any() and not rotation.any():
            return ()
        turn = rotation_matrix(rotation)
        return tuple(
            Edit(
                "joint",
                joint.name,
                {
                    "pos": tuple((joint.position + joint.frame.T @ offset).tolist()),
                    "axis": tuple((joint.frame.T @ turn @ joint.frame @ joint.axes[:, 0]).tolist()),
                },
            )
            for joint in self.drawn_joints
        )

    def select_held(self, theta: Real) -> Real:
        """Return theta: an MJCF holds places and axes of joints."""
        return theta

    def move_addition(self, theta: Real, addition: Addition, frame: Real) -> Addition:
        """Return an additional joint, moved with the joints of the drawing.

        Args:
            theta: displacement and rotation.
            addition: the joint, at its place by the drawing.
            frame: axes of the body that it is written in; (3, 3).
        """
        offset, rotation = self._displacement_and_rotation(theta)
        values = addition.element.values
        position, axis = (np.array(values[name], float) for name in ("pos", "axis"))
        moved = {
            "pos": tuple((position + frame.T @ offset).tolist()),
            "axis": tuple((frame.T @ rotation_matrix(rotation) @ frame @ axis).tolist()),
        }
        return replace(addition, element=replace(addition.element, values={**values, **moved}))


def joint_parts(machine: Machine) -> tuple[JointPart, ...]:
    """Return one Part for each stage that moves on slides and hinges outside of closed chains."""
    parts = []
    outside = [axle for axle in machine.axles if axle.chain_row is None]
    for stage, group in groupby(outside, key=lambda axle: axle.stage):
        axles = tuple(group)
        origin = np.mean([axle.anchor for axle in axles], axis=0)
        motion = machine.motion_per_twist(axles[0], origin)
        drawn = machine.drawing.joints
        drawn_joints = tuple(drawn[axle.joint] for axle in axles if axle.joint in drawn)
        parts.append(
            JointPart(stage, axles, drawn_joints, motion, origin, len(machine.coordinates))
        )
    return tuple(parts)
