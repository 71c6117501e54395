"""Shapes of a finite-element model: from files, at sensors, what they weigh, where to sense."""

from identification.shapes.fe_file import read_shapes
from identification.shapes.layouts import Telling, antinodes, effective_independence, telling
from identification.shapes.places import How, closest, shapes_at
from identification.shapes.rigid import RigidModes, check_mass, rigid_modes
from identification.shapes.shapes import Shapes

__all__ = [
    "How",
    "RigidModes",
    "Shapes",
    "Telling",
    "antinodes",
    "check_mass",
    "closest",
    "effective_independence",
    "read_shapes",
    "rigid_modes",
    "shapes_at",
    "telling",
]
