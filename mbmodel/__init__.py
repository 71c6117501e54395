"""Multibody models: MJCF to machine, its linear equation of motion, and exact derivatives of it.

"As drawn" means the nominal model, the MJCF as it was read ("the drawing").
"""

from mbmodel.mujoco_start import silence_mujoco_log  # before any import of MuJoCo

# isort: split

from mbmodel.additions import (
    directed_mass_elements,
    joint_coupling_writer,
    link_elements,
    point_mass_element,
    released_joint_elements,
    suspended_mass_elements,
)
from mbmodel.assembly import Matrices
from mbmodel.compliance.flexible_body import BendingMode, add_bending_mode, has_bending_mode
from mbmodel.compliance.released_directions import RigidDirection, release_rigid_directions
from mbmodel.control_loops.loop_part import with_loops
from mbmodel.export.branch_states import ApproximatedLaw
from mbmodel.export.comparison import StateSpaceComparison, compare_state_space
from mbmodel.export.discrete import SystemMatrices, discretise
from mbmodel.export.linear_response import respond_linearly
from mbmodel.export.state_space import export_state_space, state_space
from mbmodel.export.system_poles import system_poles
from mbmodel.frf.forward_sensitivities import ForceEntries, ForwardSensitivities
from mbmodel.frf.linearised import Evaluator, Linearised, linearise
from mbmodel.geometry.surfaces import MachineGeometry, machine_geometry
from mbmodel.linear_model_check import dynamics_error
from mbmodel.linearisation.springs import Spring
from mbmodel.machine import WORLD, Machine, parent_bodies
from mbmodel.machine_loading import load_machine
from mbmodel.measured_rest import MeasuredRest
from mbmodel.mjcf.edit import Addition, Edit, Element, MjcfLack, NotInMjcf, write_mjcf
from mbmodel.mjcf.read import Reading, mjcf_files, read_as
from mbmodel.mjcf.written_file import (
    NOT_WRITTEN,
    WrittenModel,
    refuse_difference,
    write_copy,
)
from mbmodel.model import Model, as_drawn, machine_model
from mbmodel.modes.closed_loop_modes import closed_loop_dynamics
from mbmodel.modes.energy_shares import EnergyShares, energy_shares
from mbmodel.modes.matrix_modes import Modes, modes_of_matrices
from mbmodel.modes.model_modes import model_modes, modes_with_laws, shapes_at, weighted_motions
from mbmodel.modes.sensitivities import LinearisedModes, ModeEvaluator
from mbmodel.mounting.combine import Combined, MountedStage, combine
from mbmodel.mounting.combined_file import COMBINED_NAME, STAGE_COPY_NAME
from mbmodel.mounting.place import Offset, PointMass
from mbmodel.nonlinear_joints.files import read_nonlinear_joints, write_nonlinear_joints
from mbmodel.nonlinear_joints.laws import (
    DryFriction,
    GapSpring,
    JenkinsElement,
    NonlinearJoint,
    PolynomialSpring,
)
from mbmodel.parts import (
    AddedPart,
    Change,
    ChannelPart,
    HammerGainPart,
    HammerPart,
    Parameter,
    Part,
    PartContext,
    SensorPart,
    SpringPart,
    body_parts,
    hammer_gain_parts,
    hammer_parts,
    joint_parts,
    sensor_parts,
    spring_parts,
)
from mbmodel.parts.spring_laws import (
    ConstantLoss,
    LateForce,
    Relaxation,
    StatedLaws,
    spring_law_part,
    with_spring_laws,
)
from mbmodel.ports.port_units import CONTROL, input_unit, output_unit, usual_quantity
from mbmodel.ports.ports import find_ports, parse_input, parse_output
from mbmodel.ports.request import FrfRequest
from mbmodel.ports.rest_change import REST_FACTOR, RestPart
from mbmodel.simulation.integration import TimeStep
from mbmodel.simulation.response import TimeResponse, simulate
from mbmodel.spatial import rotation_matrix, transport
from mbmodel.variants.variant_parts import with_variants
from mbmodel.virtual_test.hammer_test import VirtualTest, strike
from mbmodel.virtual_test.plan import HammerTestPlan, HitScatter, Noise, RecordedFile
from mbmodel.writing.model_edits import held_parameters, model_edits
from mbmodel.writing.written_model import read_as_written, write_model

silence_mujoco_log()

__all__ = [
    "COMBINED_NAME",
    "CONTROL",
    "NOT_WRITTEN",
    "REST_FACTOR",
    "STAGE_COPY_NAME",
    "WORLD",
    "AddedPart",
    "Addition",
    "ApproximatedLaw",
    "BendingMode",
    "Change",
    "ChannelPart",
    "Combined",
    "ConstantLoss",
    "DryFriction",
    "Edit",
    "Element",
    "EnergyShares",
    "Evaluator",
    "ForceEntries",
    "ForwardSensitivities",
    "FrfRequest",
    "GapSpring",
    "HammerGainPart",
    "HammerPart",
    "HammerTestPlan",
    "HitScatter",
    "JenkinsElement",
    "LateForce",
    "Linearised",
    "LinearisedModes",
    "Machine",
    "MachineGeometry",
    "Matrices",
    "MeasuredRest",
    "MjcfLack",
    "ModeEvaluator",
    "Model",
    "Modes",
    "MountedStage",
    "Noise",
    "NonlinearJoint",
    "NotInMjcf",
    "Offset",
    "Parameter",
    "Part",
    "PartContext",
    "PointMass",
    "PolynomialSpring",
    "Reading",
    "RecordedFile",
    "Relaxation",
    "RestPart",
    "RigidDirection",
    "SensorPart",
    "Spring",
    "SpringPart",
    "StateSpaceComparison",
    "StatedLaws",
    "SystemMatrices",
    "TimeResponse",
    "TimeStep",
    "VirtualTest",
    "WrittenModel",
    "add_bending_mode",
    "as_drawn",
    "body_parts",
    "closed_loop_dynamics",
    "combine",
    "compare_state_space",
    "directed_mass_elements",
    "discretise",
    "dynamics_error",
    "energy_shares",
    "export_state_space",
    "find_ports",
    "hammer_gain_parts",
    "hammer_parts",
    "has_bending_mode",
    "held_parameters",
    "input_unit",
    "joint_coupling_writer",
    "joint_parts",
    "linearise",
    "link_elements",
    "load_machine",
    "machine_geometry",
    "machine_model",
    "mjcf_files",
    "model_edits",
    "model_modes",
    "modes_of_matrices",
    "modes_with_laws",
    "output_unit",
    "parent_bodies",
    "parse_input",
    "parse_output",
    "point_mass_element",
    "read_as",
    "read_as_written",
    "read_nonlinear_joints",
    "refuse_difference",
    "release_rigid_directions",
    "released_joint_elements",
    "respond_linearly",
    "rotation_matrix",
    "sensor_parts",
    "shapes_at",
    "simulate",
    "spring_law_part",
    "spring_parts",
    "state_space",
    "strike",
    "suspended_mass_elements",
    "system_poles",
    "transport",
    "usual_quantity",
    "weighted_motions",
    "with_loops",
    "with_spring_laws",
    "with_variants",
    "write_copy",
    "write_mjcf",
    "write_model",
    "write_nonlinear_joints",
]
