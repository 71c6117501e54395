"""The modelled side: MJCF to machine, its equation of motion, and exact derivatives of it."""

from mbmodel.edit import Edit, NotHeld, write_mjcf
from mbmodel.machine import Machine, Spring, load_machine
from mbmodel.model import Matrices, Model, as_drawn
from mbmodel.modes import Modes, modes
from mbmodel.parts import (
    Change,
    Parameter,
    Part,
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
from mbmodel.statespace import state_space

__all__ = [
    "Change",
    "Edit",
    "Evaluator",
    "Linearised",
    "Machine",
    "Matrices",
    "Model",
    "Modes",
    "NotHeld",
    "Parameter",
    "Part",
    "Question",
    "Situation",
    "Spring",
    "SpringPart",
    "as_drawn",
    "body_parts",
    "hammer_parts",
    "joint_parts",
    "linearise",
    "load_machine",
    "modes",
    "parse_input",
    "sensor_parts",
    "spring_parts",
    "state_space",
    "write_mjcf",
]
