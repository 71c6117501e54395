"""A machine: everything that the equation of motion needs of an MJCF, at static equilibrium."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from identification.words import (
    DIRECTIONS,
    Layout,
    Loop,
    Real,
    frozen_array,
    shorten_names,
)
from mbmodel.linearisation.drawing import Drawing
from mbmodel.linearisation.gravity import Weight
from mbmodel.linearisation.motors import ActuatorGain
from mbmodel.linearisation.sensors import MujocoSensors
from mbmodel.linearisation.springs import Spring
from mbmodel.linearisation.statics import Statics
from mbmodel.measured_rest import MeasuredRest
from mbmodel.mjcf.read import Reading
from mbmodel.spatial import transport

RELEASED_MARK = ".held_"  # between stage and direction in the name of a released coordinate


@dataclass(frozen=True, eq=False)
class Axle:
    """A slide or hinge at rest, in world axes.

    Args:
        joint: name of the joint.
        coordinate: its number among the joint coordinates.
        stage: name of the body that it carries.
        turns: whether it is a hinge.
        anchor: a point on its axis [m]; (3,).
        axis: unit vector; (3,).
        chain_row: motion of a joint in a closed chain per coordinate of the machine, of which it
            need be none (``coordinate`` is then -1); None for any other joint; (nv,).
    """

    joint: str
    coordinate: int
    stage: str
    turns: bool
    anchor: Real
    axis: Real
    chain_row: Real | None = None

    def motion(self, count: int) -> Real:
        """Return the motion of the joint per coordinate of its machine; (count,).

        Args:
            count: number of the machine's coordinates.
        """
        if self.chain_row is None:
            return np.eye(1, count, self.coordinate)[0]
        return np.pad(self.chain_row, (0, count - len(self.chain_row)))

    @property
    def dof(self) -> str:
        """Direction of the axle, such as ``tx``.

        It is the end of the joint's name if that is the stage's name, an underscore and a
        direction. Otherwise it is the world axis nearest to the joint's axis.
        """
        named = self.joint.removeprefix(f"{self.stage}_")
        if named in DIRECTIONS:
            return named
        return DIRECTIONS[3 * self.turns + int(np.abs(self.axis).argmax())]


@dataclass(frozen=True, eq=False)
class Pose:
    """Where a machine rests with other parameters than those of the nominal model.

    Args:
        position: joint positions [m, rad]; (nq,).
        turns: rotation of each body from its nominal rest, world axes; (n_body, 3, 3).
        centres: place of each body's nominal centre of mass [m]; (n_body, 3).
    """

    position: Real
    turns: Real
    centres: Real


@dataclass(frozen=True, eq=False)
class Machine:
    """Rigid bodies on joints, at static equilibrium, in joint coordinates q.

    A "stage" is a body with all bodies welded to it.

    Args:
        name: of the model.
        source: path of the MJCF.
        layout: bodies, sensors and hammer points.
        coordinates: names of the joint coordinates; nv.
        jacobian: T, motion of the centres of mass per joint coordinate; (6 n_body, nv).
        body_mass: Mb, masses and inertias about the centres of mass, world axes [kg, kg m^2];
            (6 n_body, 6 n_body).
        armature: rotor inertia of joints and tendons [kg, kg m^2]; (nv, nv).
        springs: the linear springs and dampers of joints and tendons.
        remaining_stiffness: of actuators, polynomial terms and a spinning rotor. No Part changes
            it, nor the remaining damping or the armature [N/m, N m/rad]; (nv, nv).
        remaining_damping: of actuators, fluids and a spinning rotor [N s/m, N m s/rad]; (nv, nv).
        gravity: [m/s^2]; (3,).
        weight_fraction: share of each body's weight that its ``gravcomp`` leaves; (6 n_body,).
        precedence: N of the geometric stiffness of gravity: 1 where a coordinate comes before
            another on a chain, 1/2 where neither does; (nv, nv).
        axles: slides and hinges.
        motors: forces of each actuator per unit of its control, by name.
        drawing: elements of the MJCF in their bodies' frames.
        spinning: whether a hinge turns steadily.
        keyframe: name of the keyframe that gives the pose and the controls; empty for the drawing.
        remarks: sentences for the user on this linearisation.
        statics: of the MJCF, if the equilibrium follows the parameters; None if it stays.
        pose: where the machine rests, if not at its nominal rest. Body motions, forces and points
            are then in axes that turned with the bodies, in which they are as in the nominal rest.
        sensors: the MuJoCo sensors of the MJCF.
        loops: control loops that are closed around the machine.
        variants: the machine with a known mass or with a stage elsewhere, as some tests had it.
        rest: what the model lacked in the state before a change, as measured; None if unknown.
        curvature: second derivative of the motion of the centres of mass beyond what precedence
            says, in a closed chain; None without one; (6 n_body, nv, nv).
        tree: the machine of closed chains in all joint coordinates, before they are closed; None
            without a chain.
        reading: what the user wanted of the file beyond what it states.
        correct: makes the layout from that of the MJCF, where a campaign corrects sensors without
            touching the file; None where nothing is corrected.

    Raises:
        ValueError: arrays whose shapes do not fit.
    """

    name: str
    source: Path
    layout: Layout
    coordinates: tuple[str, ...]
    jacobian: Real
    body_mass: Real
    armature: Real
    springs: tuple[Spring, ...]
    remaining_stiffness: Real
    remaining_damping: Real
    gravity: Real
    weight_fraction: Real
    precedence: Real
    axles: tuple[Axle, ...]
    motors: Mapping[str, ActuatorGain]
    drawing: Drawing
    spinning: bool = False
    keyframe: str = ""
    remarks: tuple[str, ...] = ()
    statics: Statics | None = None
    pose: Pose | None = None
    sensors: MujocoSensors = field(default_factory=MujocoSensors)
    loops: tuple[Loop, ...] = ()
    variants: Mapping[str, "Machine"] = field(default_factory=dict)
    rest: MeasuredRest | None = None
    correct: Callable[[Layout], Layout] | None = None
    curvature: Real | None = None
    tree: "Machine | None" = None
    reading: Reading = field(default_factory=Reading)

    def __post_init__(self) -> None:
        """Check and freeze the arrays."""
        nv, nb = len(self.coordinates), 6 * len(self.layout.bodies)
        for name, shape in {
            "jacobian": (nb, nv),
            "body_mass": (nb, nb),
            "armature": (nv, nv),
            "remaining_stiffness": (nv, nv),
            "remaining_damping": (nv, nv),
            "gravity": (3,),
            "weight_fraction": (nb,),
            "precedence": (nv, nv),
        }.items():
            object.__setattr__(
                self, name, frozen_array(getattr(self, name), np.float64, shape, name)
            )

    def __repr__(self) -> str:
        """Return the names of bodies, coordinates and points in a few lines."""
        return (
            f"machine {self.name}: {len(self.layout.bodies)} bodies, "
            f"{len(self.coordinates)} coordinates, {len(self.layout.points)} points\n"
            f"  bodies: {shorten_names(self.layout.bodies)}\n"
            f"  coordinates: {shorten_names(self.coordinates)}"
        )

    @property
    def mass(self) -> Real:
        """Mass matrix of the joint coordinates, T' Mb T + armature [kg, kg m^2]; (nv, nv)."""
        return self.jacobian.T @ self.body_mass @ self.jacobian + self.armature

    def written_name(self, coordinate: str) -> str:
        """Return the name that a coordinate has in a written MJCF.

        That of a released direction is the stage's name, an underscore and the direction.
        """
        return coordinate.replace(RELEASED_MARK, "_")

    def driven_axle(self, motor: str) -> tuple[Axle, float] | None:
        """Return the slide or hinge on which a motor acts most, and its force per unit of control.

        Args:
            motor: of the machine, by name.

        Returns:
            None for a motor that acts on none.
        """
        gain = self.motors[motor].joint
        best: tuple[Axle, float] | None = None
        largest = 0.0
        for axle in self.axles:
            motion = axle.motion(len(gain))
            force = float(motion @ gain) / float(motion @ motion)
            if (size := abs(force) * float(np.linalg.norm(motion))) > largest * (1 + 1e-12):
                best, largest = (axle, force), size
        return best

    def motion_per_twist(self, axle: Axle, origin: Real) -> Real:
        """Return the motion of the centres of mass above a joint per twist at a point.

        Args:
            axle: of the joint.
            origin: the point [m]; (3,).

        Returns:
            (6 n_body, 6); rows of bodies that the joint does not move are zero.
        """
        is_moved = [bool(body.any()) for body in self.jacobian[:, axle.coordinate].reshape(-1, 6)]
        return np.concatenate(
            [
                transport(centre - origin) if above else np.zeros((6, 6))
                for centre, above in zip(self.layout.centres, is_moved, strict=True)
            ]
        )

    @property
    def floor_jacobian(self) -> Real:
        """Motion of the centres of mass per motion of the floor, the joints at rest; (6 n_body, 6).

        Rows of bodies that the drawing lacks, such as bending modes, are zero.
        """
        layout = self.layout
        centres = layout.centres if self.pose is None else self.pose.centres
        motion = np.stack(
            [
                transport(centre) if name in self.drawing.bodies else np.zeros((6, 6))
                for name, centre in zip(layout.bodies, centres, strict=True)
            ]
        )
        if self.pose is not None:
            turned = motion.reshape(-1, 2, 3, 6)
            motion = np.einsum("bji,bkjn->bkin", self.pose.turns, turned).reshape(-1, 6, 6)
        return motion.reshape(-1, 6)

    @cached_property
    def weight(self) -> Weight:
        """Gravity in the axes of each body, and how coordinates turn what others move."""
        if self.pose is None:
            gravity = np.tile(self.gravity, (len(self.layout.bodies), 1))
        else:
            gravity = np.einsum("bji,j->bi", self.pose.turns, self.gravity)
        return Weight(gravity, self.precedence, self.curvature)


WORLD = "world"  # MuJoCo's name of the ground


def parent_bodies(machine: Machine) -> dict[str, str | None]:
    """Return the body that each body stands on; None for the ground.

    A body moves with all coordinates of those below it: its parent is the body below with most of
    them.

    Args:
        machine: with its Jacobian.

    Returns:
        Name of the parent by the name of the body.
    """
    bodies = machine.layout.bodies
    moving = [
        frozenset(np.flatnonzero(machine.jacobian[6 * k : 6 * k + 6].any(axis=0)).tolist())
        for k in range(len(bodies))
    ]
    parents = {} if machine.tree is None else parent_bodies(machine.tree)
    for body, coordinates in zip(bodies, moving, strict=True):
        if body in parents:
            continue
        below = [
            (len(fewer), name)
            for name, fewer in zip(bodies, moving, strict=True)
            if fewer < coordinates
        ]
        parents[body] = max(below)[1] if below else None
    return parents
