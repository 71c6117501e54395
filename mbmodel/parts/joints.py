"""Where the joints of a stage sit, and along which axes."""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby

import numpy as np

from identification.words import Real
from mbmodel.linearisation.drawing import Placed
from mbmodel.machine import Axle, Machine
from mbmodel.mjcf.edit import Addition, Edit, NotHeld
from mbmodel.parts.part import Change, Known, Parameter, Situation
from mbmodel.spatial import cross_matrix, rotation_matrix, rotation_slopes, twist

_AXES = "xyz"


@dataclass(frozen=True, eq=False)
class JointPart:
    """The slides and hinges of one stage, displaced and turned as one frame.

    A coordinate moves all bodies above it by the twist of its axis: (a, 0) of a slide,
    (p x a, a) of a hinge through p. A displacement d of the joints and their rotation
    R = exp([r]x), each about its own anchor, make it (R a, 0) or ((p + d) x R a, R a); T changes
    by the difference. The pose at rest stays that of the drawing.

    Args:
        stage: name of the body that the joints carry.
        axles: its slides and hinges.
        placed: those of them that are in the MJCF: directions that it holds rigid are not.
        reach: motion of every body above per twist at ``origin``; (6 n_body, 6).
        origin: reference point of the twists [m]; (3,).
        n_coordinate: of the machine.
    """

    stage: str
    axles: tuple[Axle, ...]
    placed: tuple[Placed, ...]
    reach: Real
    origin: Real
    n_coordinate: int

    @property
    def location(self) -> str:
        """``joint:<child body>``."""
        return f"joint:{self.stage}"

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Displacement (if anything turns) and rotation vector, in world axes."""
        kinds: list[tuple[str, str, Known]] = [("rotation", "rad", "exactly")]
        if any(axle.turns for axle in self.axles):
            kinds = [("position", "m", "joint_position"), *kinds]
        return tuple(
            Parameter(f"{self.stage}.joint_{kind}_{axis}", 0.0, unit, positive=False, known=known)
            for kind, unit, known in kinds
            for axis in _AXES
        )

    def _split(self, theta: Real) -> tuple[Real, Real]:
        return (theta[:3], theta[3:]) if len(theta) == 6 else (np.zeros(3), theta)

    @cached_property
    def _select(self) -> Real:
        return np.eye(self.n_coordinate)[:, [axle.coordinate for axle in self.axles]]

    def changes(self, theta: Real, situation: Situation) -> tuple[Change, ...]:
        """Twists at theta less those of the drawing."""
        del situation
        offset, rotation = self._split(theta)
        turn = rotation_matrix(rotation)
        core = np.zeros((3, 6, len(self.axles)))
        for k, axle in enumerate(self.axles):
            arm = axle.anchor - self.origin
            core[0, :, k] = twist(axle.turns, arm + offset, turn @ axle.axis)
            core[0, :, k] -= twist(axle.turns, arm, axle.axis)
        return (Change("path", self.reach, self._select, core),)

    def slopes(self, theta: Real, situation: Situation) -> tuple[Change, ...]:
        """Derivatives of the twists."""
        del situation
        offset, rotation = self._split(theta)
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
        return (Change("path", self.reach, self._select, core),)

    def write(self, theta: Real) -> tuple[Edit | NotHeld, ...]:
        """Position and axis of every joint, unless they are as drawn.

        Where all that is drawn slides, the position is that of hinges that the drawing lacks.
        """
        offset, rotation = self._split(theta)
        drawn = {placed.name for placed in self.placed}
        if not any(axle.turns and axle.joint in drawn for axle in self.axles):
            offset = np.zeros(3)
        if not offset.any() and not rotation.any():
            return ()
        turn = rotation_matrix(rotation)
        return tuple(
            Edit(
                "joint",
                placed.name,
                {
                    "pos": tuple((placed.position + placed.frame.T @ offset).tolist()),
                    "axis": tuple(
                        (placed.frame.T @ turn @ placed.frame @ placed.axes[:, 0]).tolist()
                    ),
                },
            )
            for placed in self.placed
        )

    def carried(self, theta: Real, more: Addition, frame: Real) -> Addition:
        """A joint that the drawing lacks, moved with those that it has.

        Args:
            theta: displacement and rotation.
            more: the joint, where it is by the drawing.
            frame: axes of the body that it is written in; (3, 3).
        """
        offset, rotation = self._split(theta)
        values = more.element.values
        position, axis = (np.array(values[name], float) for name in ("pos", "axis"))
        moved = {
            "pos": tuple((position + frame.T @ offset).tolist()),
            "axis": tuple((frame.T @ rotation_matrix(rotation) @ frame @ axis).tolist()),
        }
        return replace(more, element=replace(more.element, values={**values, **moved}))


def joint_parts(machine: Machine) -> tuple[JointPart, ...]:
    """One Part for each stage that moves on slides and hinges."""
    parts = []
    for stage, group in groupby(machine.axles, key=lambda axle: axle.stage):
        axles = tuple(group)
        origin = np.mean([axle.anchor for axle in axles], axis=0)
        reach = machine.reach(axles[0], origin)
        drawn = machine.drawing.joints
        placed = tuple(drawn[axle.joint] for axle in axles if axle.joint in drawn)
        parts.append(JointPart(stage, axles, placed, reach, origin, len(machine.coordinates)))
    return tuple(parts)
