"""Shared data types of the workbench: labelled, validated on building and read-only."""

from identification.words._arrays import (
    MAX_FREQUENCY_HZ,
    MAX_INPUT_MAGNITUDE,
    MIN_FREQUENCY_HZ,
    Complex,
    Integers,
    Mask,
    Real,
    frozen_array,
)
from identification.words.campaign import (
    DEFAULT_HAMMER,
    TOLERANCE_BOUND_SIGMA,
    Campaign,
    Condition,
    State,
    Test,
    Tolerance,
)
from identification.words.control_loop import (
    Controller,
    Loop,
    PortSum,
    between_multiples,
    poles_in_s,
    zero_order_hold,
)
from identification.words.dof import DIRECTIONS, Dof, distinct_dofs
from identification.words.errors import ConvergenceError, InputError, UsageError, WorkbenchError
from identification.words.frf import DERIVATIVE_ORDER, Frf, FrfEstimate, Quantity, VarianceSource
from identification.words.gains import NominalGain, UnknownGains
from identification.words.hits import (
    Estimator,
    Hit,
    HitEstimate,
    HitRejection,
    PeakSlope,
    SignalTraces,
    SpectralDensities,
)
from identification.words.large_tests import MAX_SHOWN_VALUES, thinning_step
from identification.words.layout import Layout, is_hammer_point, node_number
from identification.words.modal import ModalModel, drive_point_scale, modal_sum
from identification.words.names import percent_text, shorten_names
from identification.words.poles import HasPoles
from identification.words.records import Records
from identification.words.signal import (
    JOINT_PREFIX,
    Input,
    Output,
    Port,
    Signal,
    parse_port,
    settle_port,
    split_label,
)

__all__ = [
    "DEFAULT_HAMMER",
    "DERIVATIVE_ORDER",
    "DIRECTIONS",
    "JOINT_PREFIX",
    "MAX_FREQUENCY_HZ",
    "MAX_INPUT_MAGNITUDE",
    "MAX_SHOWN_VALUES",
    "MIN_FREQUENCY_HZ",
    "TOLERANCE_BOUND_SIGMA",
    "Campaign",
    "Complex",
    "Condition",
    "Controller",
    "ConvergenceError",
    "Dof",
    "Estimator",
    "Frf",
    "FrfEstimate",
    "HasPoles",
    "Hit",
    "HitEstimate",
    "HitRejection",
    "Input",
    "InputError",
    "Integers",
    "Layout",
    "Loop",
    "Mask",
    "ModalModel",
    "NominalGain",
    "Output",
    "PeakSlope",
    "Port",
    "PortSum",
    "Quantity",
    "Real",
    "Records",
    "Signal",
    "SignalTraces",
    "SpectralDensities",
    "State",
    "Test",
    "Tolerance",
    "UnknownGains",
    "UsageError",
    "VarianceSource",
    "WorkbenchError",
    "between_multiples",
    "distinct_dofs",
    "drive_point_scale",
    "frozen_array",
    "is_hammer_point",
    "modal_sum",
    "node_number",
    "parse_port",
    "percent_text",
    "poles_in_s",
    "settle_port",
    "shorten_names",
    "split_label",
    "thinning_step",
    "zero_order_hold",
]
