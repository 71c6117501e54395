"""Parts: named, parametrised, low-rank changes of the equation of motion."""

from mbmodel.parts.added import AddedPart
from mbmodel.parts.attached import AttachedPart, Stinger
from mbmodel.parts.bodies import BodyPart, body_parts
from mbmodel.parts.channels import ChannelPart, HammerGainPart, hammer_gain_parts
from mbmodel.parts.joints import JointPart, joint_parts
from mbmodel.parts.part import (
    Change,
    ConditionalPart,
    Parameter,
    Part,
    PartContext,
    Slot,
    ToleranceKind,
)
from mbmodel.parts.sensors_and_hammer import HammerPart, SensorPart, hammer_parts, sensor_parts
from mbmodel.parts.springs import SpringPart, spring_parts

__all__ = [
    "AddedPart",
    "AttachedPart",
    "BodyPart",
    "Change",
    "ChannelPart",
    "ConditionalPart",
    "HammerGainPart",
    "HammerPart",
    "JointPart",
    "Parameter",
    "Part",
    "PartContext",
    "SensorPart",
    "Slot",
    "SpringPart",
    "Stinger",
    "ToleranceKind",
    "body_parts",
    "hammer_gain_parts",
    "hammer_parts",
    "joint_parts",
    "sensor_parts",
    "spring_parts",
]
