"""Shapes of a finite-element model: from files, at sensors, what they weigh, where to sense."""

from identification.shapes.fe_file import read_shapes
from identification.shapes.fe_shapes import Shapes
from identification.shapes.rigid_mass import RigidModes, check_mass, rigid_modes
from identification.shapes.sensor_placement import (
    Telling,
    antinodes,
    effective_independence,
    telling,
)
from identification.shapes.sensor_shapes import How, closest, shapes_at

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
