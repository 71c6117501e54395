"""Mode shapes of a finite-element model: reading, values at sensors, mass, sensor placement."""

from identification.shapes.fe_file import Shapes, read_shapes
from identification.shapes.rigid_mass import MassCheck, RigidModes, compare_mass, rigid_modes
from identification.shapes.sensor_placement import (
    antinodes,
    distinguish_modes,
    effective_independence,
)
from identification.shapes.sensor_shapes import ShapeSampling, closest_barycentric, shapes_at

__all__ = [
    "MassCheck",
    "RigidModes",
    "ShapeSampling",
    "Shapes",
    "antinodes",
    "closest_barycentric",
    "compare_mass",
    "distinguish_modes",
    "effective_independence",
    "read_shapes",
    "rigid_modes",
    "shapes_at",
]
