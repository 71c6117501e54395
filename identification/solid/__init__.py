"""Solid bodies: from sensors to motions and back, up to where that holds, and which sensor lies."""

from identification.solid.bending_shapes import BendingShape, bending_shape
from identification.solid.body_check import BodyCheck, Fault, check_bodies
from identification.solid.reduction import body_inverse, reconstruct, reduce_to_bodies
from identification.solid.sensor_faults import delayed, mount
from identification.solid.sentences import FAULTS

__all__ = [
    "FAULTS",
    "BendingShape",
    "BodyCheck",
    "Fault",
    "bending_shape",
    "body_inverse",
    "check_bodies",
    "delayed",
    "mount",
    "reconstruct",
    "reduce_to_bodies",
]
