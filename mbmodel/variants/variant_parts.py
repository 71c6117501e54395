"""Machines with variants: what they must share, and the Parts of a model in a variant.

Parts of a nominal machine as they act in a variant of it, with the same parameters.

Motion of the bodies of a variant by that of the nominal machine's reference points.

A variant has centres of mass of its own, and its bodies may stand elsewhere and be turned. With R
the rotation of a body from the nominal machine to the variant, c' its centre of mass there, and p
the nominal centre of mass carried along with the body, a motion (v, w) about c' in world axes is

    A (v, w),    A = [[R', 0], [0, R']] [[1, -[p - c']x], [0, 1]]

about p in the axes that turned with the body, in which Parts of the nominal machine are written.
Their forces become A' times themselves.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from identification.words import Condition, InputError, Real, shorten_names
from mbmodel.machine import Machine, parent_bodies
from mbmodel.mjcf.edit import Addition, Edit, NotInMjcf
from mbmodel.parts import (
    Change,
    ConditionalPart,
    JointPart,
    Parameter,
    Part,
    PartContext,
    SpringPart,
    joint_parts,
    spring_parts,
)
from mbmodel.parts.channels import ChannelPart, HammerGainPart
from mbmodel.spatial import transport

_SAME_PLACE_M = 1e-9  # of a joint in two machines: rounding
# Parts whose changes depend on no place: factors of inputs and of readings.
_PLACELESS = (ChannelPart, HammerGainPart)


def with_variants(machine: Machine, variants: Mapping[str, Machine]) -> Machine:
    """Return a machine with variants of it, in which tests may have been made.

    Args:
        variants: machines by the name of the variant.

    Raises:
        InputError: a variant with other bodies, joints or springs, or a hung machine.
    """
    for variant in variants.values():
        _refuse_unlike(machine, variant)
    return replace(machine, variants=dict(variants))


def _refuse_unlike(machine: Machine, variant: Machine) -> None:
    """Refuse a variant that does not have the same bodies, coordinates and springs.

    Raises:
        InputError: what differs.
    """
    kinds = (
        ("bodies", machine.layout.bodies, variant.layout.bodies),
        ("joints", machine.coordinates, variant.coordinates),
        ("springs and dampers", _coefficients(machine), _coefficients(variant)),
    )
    for kind, nominal, varied in kinds:
        if nominal != varied:
            differing = sorted(set(nominal) ^ set(varied)) or [*varied]
            raise InputError(
                f"{variant.source}: its {kind} are not those of {machine.source.name} "
                f"({shorten_names(differing)} differ): a test's own model may add mass to bodies, "
                "welded to them without joints of its own, and keeps order and names"
            )
    for either in (machine, variant):
        if either.statics is not None:
            raise InputError(
                f"{either.source}: its equilibrium follows its springs and masses, as of a hung "
                "machine, which is not handled for tests with models or poses of their own: make a "
                "campaign of each"
            )


def _coefficients(machine: Machine) -> tuple[str, ...]:
    """Return the names of stiffness and damping of all springs."""
    return tuple(parameter.name for part in spring_parts(machine) for parameter in part.parameters)


def has_moved_stages(machine: Machine) -> bool:
    """Return whether some variant of a machine has a stage elsewhere."""
    anchors = np.array([axle.anchor for axle in machine.axles])
    return any(
        not np.allclose(anchors, [axle.anchor for axle in variant.axles], atol=_SAME_PLACE_M)
        for variant in machine.variants.values()
    )


def parts_in_variant(machine: Machine, variant: Machine, parts: Sequence[Part]) -> tuple[Part, ...]:
    """Return the Parts of a model as they act in a variant, with equal parameters.

    Springs and joints are those of the variant's geometry. What sits on a body is carried with it.

    Args:
        machine: nominal machine of the model.
        variant: of the machine, with the same coordinates.
        parts: of the model.
    """
    springs = {part.location: part for part in spring_parts(variant)}
    joints = {part.stage: part for part in joint_parts(variant)}
    to_nominal, nominal = motion_to_nominal(machine, variant), PartContext(machine)
    turns, parents = body_rotations(machine, variant), parent_bodies(machine)

    def in_variant(part: Part) -> Part:
        """Return one Part in the variant."""
        if isinstance(part, SpringPart):
            return springs[part.location]
        if isinstance(part, JointPart):
            parent = parents[part.stage]
            turn: Real = np.eye(3) if parent is None else turns.get(parent, np.eye(3))
            return TurnedJointPart(joints[part.stage], part, turn)
        return part if isinstance(part, _PLACELESS) else CarriedPart(part, nominal, to_nominal)

    return tuple(in_variant(part) for part in parts)


class _WrittenByNominal:
    """Part of a variant: a written MJCF is that of the nominal machine, and holds nothing of it."""

    def write(self, theta: Real) -> tuple[Edit | Addition | NotInMjcf, ...]:
        """Return nothing: the nominal machine is written."""
        del theta
        return ()

    def select_held(self, theta: Real) -> Real:
        """Return theta, which the Part of the nominal machine writes."""
        return theta


@dataclass(frozen=True, eq=False)
class CarriedPart(_WrittenByNominal):
    """A Part that is carried along with the bodies of a variant.

    Args:
        part: Part of the nominal machine.
        nominal: context of that machine, apart from any test.
        to_nominal: A, motion of the nominal reference points by that of the variant's bodies;
            (6 n_body, 6 n_body).
    """

    part: Part
    nominal: PartContext
    to_nominal: Real

    @property
    def location(self) -> str:
        """Place in the machine."""
        return self.part.location

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters, those of the nominal machine."""
        return self.part.parameters

    def acts(self, condition: Condition | None) -> float:
        """Return the fraction of the Part that acts in a test."""
        return self.part.acts(condition) if isinstance(self.part, ConditionalPart) else 1.0

    def changes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the finite change at theta."""
        return self._carry(self.part.changes(theta, self._at(context)))

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the derivative of the change by each parameter."""
        return self._carry(self.part.slopes(theta, self._at(context)))

    def _at(self, context: PartContext) -> PartContext:
        """Return the nominal machine in the test of a context."""
        return replace(self.nominal, condition=context.condition)

    def _carry(self, changes: tuple[Change, ...]) -> tuple[Change, ...]:
        """Return changes at the bodies of the variant."""
        return tuple(self._carry_change(change) for change in changes)

    def _carry_change(self, change: Change) -> Change:
        transposed = self.to_nominal.T
        if change.slot == "body":
            return replace(change, left=transposed @ change.left, right=transposed @ change.right)
        if change.slot in ("sensor", "hammer"):
            return replace(change, right=transposed @ change.right)
        if change.slot == "path":
            columns = np.asarray(np.linalg.solve(self.to_nominal, change.left), np.float64)
            return replace(change, left=columns)
        return change


@dataclass(frozen=True, eq=False)
class TurnedJointPart(_WrittenByNominal):
    """The joints of a stage whose parent is turned in a variant: vectors turn with the parent.

    Args:
        part: Part of the variant, in world axes.
        nominal: Part of the nominal machine, whose parameters it has.
        turn: rotation of the parent from the nominal machine to the variant; (3, 3).
    """

    part: JointPart
    nominal: JointPart
    turn: Real

    @property
    def location(self) -> str:
        """Place in the machine."""
        return self.nominal.location

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters, those of the nominal machine."""
        return self.nominal.parameters

    @property
    def _map(self) -> Real:
        """Parameters of the variant by those of the nominal machine; (n, n)."""
        return np.asarray(np.kron(np.eye(len(self.parameters) // 3), self.turn), np.float64)

    def changes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the finite change at theta."""
        return self.part.changes(self._map @ theta, context)

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the derivative of the change by each parameter."""
        turned = self.part.slopes(self._map @ theta, context)
        return tuple(
            replace(change, core=np.tensordot(self._map.T, change.core, 1)) for change in turned
        )


def body_rotations(machine: Machine, variant: Machine) -> dict[str, Real]:
    """Return the rotation of each drawn body from a machine to its variant; (3, 3) each.

    Args:
        variant: with the same bodies.
    """
    return {
        name: variant.drawing.bodies[name].frame @ machine.drawing.bodies[name].frame.T
        for name in machine.layout.bodies
        if name in machine.drawing.bodies
    }


def motion_to_nominal(machine: Machine, variant: Machine) -> Real:
    """Return A of all bodies; (6 n_body, 6 n_body). Bodies that the drawing lacks keep theirs.

    Args:
        variant: with the same bodies in the same order.
    """
    rotations, blocks = body_rotations(machine, variant), []
    for number, name in enumerate(machine.layout.bodies):
        if name not in rotations:
            blocks.append(np.eye(6))
            continue
        turn = rotations[name]
        nominal, moved = machine.drawing.bodies[name], variant.drawing.bodies[name]
        arm = turn @ (machine.layout.centres[number] - nominal.origin)
        point = moved.origin + arm
        turned = np.kron(np.eye(2), turn.T)
        blocks.append(turned @ transport(point - variant.layout.centres[number]))
    return block_diag(*blocks)
