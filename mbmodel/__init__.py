"""The modelled side: MJCF to machine, its equation of motion, and exact derivatives of it."""

from mbmodel.additions import by_joints, freed, hung, linked
from mbmodel.bending import Bending, with_bending
from mbmodel.edit import Addition, Edit, NotHeld, write_mjcf
from mbmodel.energy import Energy, energy
from mbmodel.forward import Forward
from mbmodel.looks import Looks, looks
from mbmodel.loosened import Held, loosened
from mbmodel.machine import Machine, load_machine, parents_of
from mbmodel.meshes import mesh_files
from mbmodel.mode_slopes import LinearisedModes, ModeEvaluator
from mbmodel.model import Matrices, Model, as_drawn
from mbmodel.modes import Modes, model_modes, modes, shapes_at
from mbmodel.parts import (
    AddedPart,
    Change,
    HammerPart,
    Parameter,
    Part,
    SensorPart,
    Situation,
    SpringPart,
    body_parts,
    hammer_parts,
    joint_parts,
    sensor_parts,
    spring_parts,
)
from mbmodel.places import parse_input
from mbmodel.question import Question
from mbmodel.response import Evaluator, Linearised, linearise
from mbmodel.spatial import rotation_matrix, transport
from mbmodel.springs import Spring
from mbmodel.statespace import state_space
from mbmodel.transient import respond

__all__ = [
    "AddedPart",
    "Addition",
    "Bending",
    "Change",
    "Edit",
    "Energy",
    "Evaluator",
    "Forward",
    "HammerPart",
    "Held",
    "Linearised",
    "LinearisedModes",
    "Looks",
    "Machine",
    "Matrices",
    "ModeEvaluator",
    "Model",
    "Modes",
    "NotHeld",
    "Parameter",
    "Part",
    "Question",
    "SensorPart",
    "Situation",
    "Spring",
    "SpringPart",
    "as_drawn",
    "body_parts",
    "by_joints",
    "energy",
    "freed",
    "hammer_parts",
    "hung",
    "joint_parts",
    "linearise",
    "linked",
    "load_machine",
    "looks",
    "loosened",
    "mesh_files",
    "model_modes",
    "modes",
    "parents_of",
    "parse_input",
    "respond",
    "rotation_matrix",
    "sensor_parts",
    "shapes_at",
    "spring_parts",
    "state_space",
    "transport",
    "with_bending",
    "write_mjcf",
]
