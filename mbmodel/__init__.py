"""The modelled side: MJCF to machine, its equation of motion, and exact derivatives of it."""

from mbmodel.edit import write_mjcf
from mbmodel.machine import Machine, Spring, load_machine
from mbmodel.model import Matrices, Model, as_drawn
from mbmodel.modes import Modes, modes
from mbmodel.parts import Change, Parameter, Part, Situation, SpringPart, spring_parts
from mbmodel.response import Evaluator, Linearised, Question, linearise
from mbmodel.statespace import state_space

__all__ = [
    "Change",
    "Evaluator",
    "Linearised",
    "Machine",
    "Matrices",
    "Model",
    "Modes",
    "Parameter",
    "Part",
    "Question",
    "Situation",
    "Spring",
    "SpringPart",
    "as_drawn",
    "linearise",
    "load_machine",
    "modes",
    "spring_parts",
    "state_space",
    "write_mjcf",
]
