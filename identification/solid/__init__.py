"""Solid bodies: reduction of sensors to rigid motions, reconstruction, and sensor faults."""

from identification.solid.bending_shapes import BendingShape, estimate_bending_shape
from identification.solid.body_check import BodyCheck, Fault, check_bodies
from identification.solid.fault_search import MIN_REDUNDANT_CHANNELS
from identification.solid.reduction import (
    body_inverse,
    reconstruct,
    reduce_to_bodies,
    reduction_covariance,
)
from identification.solid.sensor_faults import MOUNT_ENDS, delay_response, mount_response
from identification.solid.sentences import FAULT_PHRASES, exchange_phrase

__all__ = [
    "FAULT_PHRASES",
    "MIN_REDUNDANT_CHANNELS",
    "MOUNT_ENDS",
    "BendingShape",
    "BodyCheck",
    "Fault",
    "body_inverse",
    "check_bodies",
    "delay_response",
    "estimate_bending_shape",
    "exchange_phrase",
    "mount_response",
    "reconstruct",
    "reduce_to_bodies",
    "reduction_covariance",
]
