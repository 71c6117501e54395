"""The modelled side: MJCF to machine, its equation of motion, and exact derivatives of it."""

from mbmodel.additions import by_joints, freed, hung, linked
from mbmodel.compliance.flexible_body import Bending, with_bending
from mbmodel.compliance.released_directions import Held, loosened
from mbmodel.export.state_space import state_space
from mbmodel.export.transient import respond
from mbmodel.frf.forward_sensitivities import Forward
from mbmodel.frf.linearised import Evaluator, Linearised, linearise
from mbmodel.frf.ports import parse_input
from mbmodel.frf.request import Question
from mbmodel.geometry.surfaces import Looks, looks
from mbmodel.linearisation.springs import Spring
from mbmodel.machine import Machine, load_machine, parents_of
from mbmodel.meshes.compile import mesh_files
from mbmodel.mjcf.edit import Addition, Edit, NotHeld, write_mjcf
from mbmodel.model import Matrices, Model, as_drawn
from mbmodel.modes.energy_shares import Energy, energy
from mbmodel.modes.model_modes import Modes, model_modes, modes_of_matrices, shapes_at
from mbmodel.modes.sensitivities import LinearisedModes, ModeEvaluator
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
from mbmodel.spatial import rotation_matrix, transport

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
    "modes_of_matrices",
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
