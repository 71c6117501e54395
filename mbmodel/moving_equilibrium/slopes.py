"""Derivatives of a model through its static equilibrium, by the implicit function theorem.

At rest the net force r(q, theta) vanishes, so that

    dq/dtheta = K^-1 dr/dtheta,   K = -dr/dq.

T and the coefficients A of the equation of motion at the joints, A = [K, C, M], depend on q through
the geometry alone. Their derivatives by q, at fixed theta, are central differences of the
linearisation. A parameter then adds, beside the slopes of its Part at the fixed pose,

    dT = T_q dq,   dZj = A_q dq - (dT' Zb T + T' Zb dT + the change of gravity's stiffness with dT):

the second term takes off what a change of T brings about by itself. Of a joint that is displaced,
the derivatives at fixed q are differences as well: off its zero, it moves the bodies above it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np
import scipy.linalg

from identification.words import Condition, Mask, Real
from mbmodel.assembly import Assembly
from mbmodel.linearisation.gravity import gravity_slope
from mbmodel.linearisation.statics import Statics
from mbmodel.linearisation.tendon_slopes import FOURTH_ORDER_WEIGHTS
from mbmodel.machine import Pose
from mbmodel.moving_equilibrium.posed_machine import (
    is_static,
    model_at_pose,
    static_edits,
)
from mbmodel.parts import Change, JointPart, Parameter, Part, PartContext
from mbmodel.posed_model import PosedModel

# m or rad: of central differences of fourth order. Truncation is 1e-10 over a length of 0.3 m,
# rounding 1e-8 of the tension of wires, whose curvature is a difference itself.
_POSE_STEP = 1e-3
_FORCE_STEP = 1e-5  # m or rad: of differences of forces by the place of a joint or centre
_RELATIVE_STEP = 1e-3  # of a size; forces at rest are linear in stiffness and mass
# Of the largest squared frequency: a stiffer direction is not free.
_MIN_STIFFNESS_SHARE = 1e-12


@dataclass(frozen=True, eq=False)
class Derivative:
    """Derivatives of T and of the coefficients of the equation of motion along some directions.

    Args:
        jacobian: (n, 6 n_body, nv).
        coefficients: of s^0, s^1, s^2; (n, 3, nv, nv).
    """

    jacobian: Real
    coefficients: Real


class EquilibriumPoint:
    """A model at its equilibrium at theta, with derivatives by the pose.

    Args:
        model: whose machine has its statics.
        theta: parameters in SI; (n_parameter,).
        statics: of the machine.
        pose: of the machine at rest; None at its nominal rest.
        condition: of the test, or None.
    """

    def __init__(
        self,
        model: PosedModel,
        theta: Real,
        statics: Statics,
        pose: Pose | None,
        condition: Condition | None = None,
    ) -> None:
        self.model, self.theta, self.condition, self.statics = model, theta, condition, statics
        self.position = statics.pose if pose is None else pose.position
        self.changed = statics.with_edits(static_edits(model, theta))
        self.assembly = self._assembly_at(theta, self.changed, self.position)

    def _assembly_at(self, theta: Real, changed: mujoco.MjModel, position: Real) -> Assembly:
        """Return the equation of motion at a pose."""
        return model_at_pose(self.model, theta, changed, position).assemble(theta, self.condition)

    def by_pose(self, direction: Real) -> Derivative:
        """Return the derivative along one direction of the joint coordinates; n = 1.

        Args:
            direction: of unit size in its largest coordinate [m or rad]; (n_coordinate,).
        """

        def assembly_at(step: float) -> Assembly:
            position = self.statics.move(self.changed, self.position, direction, step)
            return self._assembly_at(self.theta, self.changed, position)

        return _differentiate(assembly_at)

    def by_joint(self, index: int) -> Derivative:
        """Return the derivative by one parameter of a joint at a fixed pose; n = 1.

        Args:
            index: of the parameter in theta.
        """

        def assembly_at(step: float) -> Assembly:
            theta = self.theta.copy()
            theta[index] += step
            changed = self.statics.with_edits(static_edits(self.model, theta))
            return self._assembly_at(theta, changed, self.position)

        return _differentiate(assembly_at)

    def displacements(self, forces: Real) -> Real:
        """Return K^-1 f of the static Parts; free directions stay; (n_coordinate, n).

        Args:
            forces: f; (n_coordinate, n).
        """
        shapes, amounts = self._flexibility
        return shapes @ (amounts[:, None] * (shapes.T @ forces))

    @cached_property
    def _flexibility(self) -> tuple[Real, Real]:
        """Shapes of the static Parts with unit mass, and their inverse stiffness or 0 if free."""
        nv = self.statics.n_coordinate
        keep = [number for number, part in enumerate(self.model.parts) if is_static(part)]
        pieces = self.model.split_parameters(self.theta)
        bare = replace(self.model, parts=tuple(self.model.parts[number] for number in keep))
        theta = np.concatenate([*(pieces[number] for number in keep), np.zeros(0)])
        matrices = model_at_pose(bare, theta, self.changed, self.position).matrices(theta)
        stiffness = matrices.stiffness[:nv, :nv]
        values, shapes = scipy.linalg.eigh((stiffness + stiffness.T) / 2, matrices.mass[:nv, :nv])
        free = np.abs(values) <= _MIN_STIFFNESS_SHARE * np.abs(values).max(initial=0.0)
        return shapes, np.where(free, 0.0, 1.0 / np.where(free, 1.0, values))

    def force_slopes(self, part: Part, values: Real, chosen: Mask | None = None) -> Real:
        """Return the derivative of the net force by each parameter of a Part; (n_coordinate, n).

        Args:
            part: a static Part.
            values: its parameters.
            chosen: parameters of interest, the others get zeros; all if None.
        """
        data = self.statics.data_at(self.changed, self.position)
        chains = self.statics.chains_at(self.changed, data)
        slopes = np.zeros((self.statics.n_coordinate, len(values)))
        for index in range(len(values)) if chosen is None else np.flatnonzero(chosen):
            step = static_step(part.parameters[index]) * np.eye(len(values))[index]
            change = self.statics.force_change(
                self.changed, data, part.write(values - step), part.write(values + step)
            )
            change = change if chains is None else chains.force(change)
            slopes[:, index] = change / (2 * step[index])
        return slopes

    def path_share(self, jacobian_change: Real) -> Real:
        """Return what changes of T do to the coefficients; (n, 3, nv, nv).

        Args:
            jacobian_change: dT; (n, 6 n_body, nv).
        """
        assembly = self.assembly
        machine, body, jacobian = assembly.machine, assembly.body, assembly.jacobian
        left = jacobian_change.swapaxes(1, 2)[:, None] @ (body @ jacobian)
        right = (jacobian.T @ body) @ jacobian_change[:, None]
        share: Real = left + right
        if assembly.has_weight:
            for total, change in zip(share, jacobian_change, strict=True):
                total[0] += gravity_slope(
                    machine.weight,
                    jacobian,
                    assembly.weight_bearing_mass,
                    jacobian_change=change,
                )
        return share


def static_step(parameter: Parameter) -> float:
    """Return a step for differences by a parameter."""
    return _RELATIVE_STEP * abs(parameter.drawn) if parameter.positive else _FORCE_STEP


def _differentiate(assembly_at: Callable[[float], Assembly]) -> Derivative:
    """Return the derivative of the equation of motion by a step [m or rad] at zero."""
    jacobian: Real = np.zeros(())
    coefficients: Real = np.zeros(())
    for sign, weight in FOURTH_ORDER_WEIGHTS.items():
        assembly = assembly_at(sign * _POSE_STEP)
        matrices, rate = assembly.matrices, weight / _POSE_STEP
        jacobian = jacobian + rate * assembly.jacobian
        coefficients = coefficients + rate * np.stack(
            [matrices.stiffness, matrices.damping, matrices.mass]
        )
    return Derivative(jacobian[None], coefficients[None])


def equilibrium_slopes(
    model: PosedModel,
    theta: Real,
    condition: Condition | None,
    chosen_of_parts: Sequence[Mask],
    pose: Pose | None,
) -> list[tuple[Change, ...]]:
    """Return what each Part's parameters change through the equilibrium, beside its own slopes.

    Args:
        model: whose machine has its statics.
        theta: parameters in SI; (n_parameter,).
        chosen_of_parts: parameters of interest, Part by Part.
        pose: of the machine at rest; None at its nominal rest.
    """
    statics = model.machine.statics
    added: list[tuple[Change, ...]] = [() for _ in model.parts]
    if statics is None:
        return added
    point = EquilibriumPoint(model, theta, statics, pose, condition)
    numbers = [
        number
        for number, (part, mask) in enumerate(zip(model.parts, chosen_of_parts, strict=True))
        if is_static(part) and mask.any()
    ]
    pieces = model.split_parameters(theta)
    moves = [
        point.displacements(
            point.force_slopes(model.parts[number], pieces[number], chosen_of_parts[number])
        )
        for number in numbers
    ]
    no_move = np.zeros((statics.n_coordinate, 0))
    by_coordinate = _by_coordinates(point, np.concatenate([*moves, no_move], axis=1))
    starts = np.cumsum([0, *(len(part.parameters) for part in model.parts)])
    for number, move in zip(numbers, moves, strict=True):
        jacobian = np.tensordot(move.T, by_coordinate.jacobian, 1)
        coefficients = np.tensordot(move.T, by_coordinate.coefficients, 1)
        part = model.parts[number]
        if isinstance(part, JointPart):
            at_fixed_pose = _joint_corrections(
                point, part, pieces[number], int(starts[number]), chosen_of_parts[number]
            )
            jacobian, coefficients = (
                jacobian + at_fixed_pose.jacobian,
                coefficients + at_fixed_pose.coefficients,
            )
        if jacobian.any() or coefficients.any():
            added[number] = _dense_changes(jacobian, coefficients)
    return added


def _by_coordinates(point: EquilibriumPoint, moves: Real) -> Derivative:
    """Return derivatives by each coordinate that some parameter moves, less what T does by itself.

    Args:
        moves: displacements; (n_coordinate, n).
    """
    nv = len(moves)
    size, count = point.assembly.jacobian.shape
    jacobian, coefficients = np.zeros((nv, size, count)), np.zeros((nv, 3, count, count))
    for coordinate in np.flatnonzero(moves.any(axis=1)):
        derivative = point.by_pose(np.eye(nv)[coordinate])
        jacobian[coordinate], coefficients[coordinate] = (
            derivative.jacobian[0],
            derivative.coefficients[0] - point.path_share(derivative.jacobian)[0],
        )
    return Derivative(jacobian, coefficients)


def _joint_corrections(
    point: EquilibriumPoint, part: JointPart, values: Real, start: int, chosen: Mask
) -> Derivative:
    """Return what a joint's parameters change at a fixed pose beside the slopes of its Part.

    Args:
        part: of the joint.
        start: number of its first parameter in theta.
        chosen: parameters of interest, the others get zeros.
    """
    size, count = point.assembly.jacobian.shape
    jacobian, coefficients = (
        np.zeros((len(values), size, count)),
        np.zeros((len(values), 3, count, count)),
    )
    (at_fixed_pose,) = part.slopes(values, PartContext(point.assembly.machine, point.condition))
    for index in np.flatnonzero(chosen):
        derivative = point.by_joint(start + int(index))
        share = point.path_share(derivative.jacobian)
        jacobian[index] = (
            derivative.jacobian[0]
            - at_fixed_pose.left @ at_fixed_pose.core[index, 0] @ at_fixed_pose.right.T
        )
        coefficients[index] = derivative.coefficients[0] - share[0]
    return Derivative(jacobian, coefficients)


def _dense_changes(jacobian: Real, coefficients: Real) -> tuple[Change, ...]:
    """Return slopes of T and of the coefficients at the joints.

    Args:
        jacobian: (n_parameter, 6 n_body, nv).
        coefficients: (n_parameter, 3, nv, nv).
    """
    path = np.zeros((len(jacobian), 3, *jacobian.shape[1:]))
    path[:, 0] = jacobian
    bodies, joints = np.eye(jacobian.shape[1]), np.eye(jacobian.shape[2])
    return (
        Change("path", bodies, joints, path),
        Change("joint", joints, joints, coefficients),
    )
