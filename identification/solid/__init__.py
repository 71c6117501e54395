"""Solid bodies: from sensors to motions and back, up to where that holds, and which sensor lies."""

from identification.solid.check import BodyCheck, Fault, check_bodies
from identification.solid.reduce import reconstruct, reduce_to_bodies

__all__ = ["BodyCheck", "Fault", "check_bodies", "reconstruct", "reduce_to_bodies"]
