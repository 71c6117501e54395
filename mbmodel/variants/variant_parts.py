"""Machines with variants: what they must share, and the Parts of a model in a variant."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from identification.words import InputError, Real, shorten_names
from mbmodel.machine import Machine, parent_bodies
from mbmodel.parts import JointPart, Part, PartContext, SpringPart, joint_parts, spring_parts
from mbmodel.parts.channels import ChannelPart
from mbmodel.parts.hammer_gain import HammerGainPart
from mbmodel.variants.body_frames import body_rotations, motion_to_nominal
from mbmodel.variants.carried_parts import CarriedPart, TurnedJointPart

_SAME_PLACE_M = 1e-9  # of a joint in two machines: rounding
# Parts whose changes depend on no place: factors of inputs and of readings.
_PLACELESS = (ChannelPart, HammerGainPart)


def with_variants(machine: Machine, variants: Mapping[str, Machine]) -> Machine:
    """Return a machine with variants of it, in which tests may have been made.

    Args:
        machine: nominal machine.
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
