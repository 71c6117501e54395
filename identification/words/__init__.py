"""The words that every part of the workbench speaks: labelled, validated, frozen. Numpy only."""

from identification.words._arrays import Complex, Integers, Mask, Real, frozen
from identification.words.campaign import Campaign, Condition, Test, Tolerance
from identification.words.dof import DIRECTIONS, Dof, distinct
from identification.words.errors import ConvergenceError, InputError, UsageError, WorkbenchError
from identification.words.frf import ORDER, Frf, FrfEstimate, Quantity, VarianceSource
from identification.words.hits import Densities, Estimator, Hit, HitEstimate, Rejected
from identification.words.layout import Layout, is_hammer, node_of
from identification.words.modal import ModalModel, drive_point_scale, modal_sum
from identification.words.motor import Input, Motor
from identification.words.poles import HasPoles
from identification.words.records import Records

__all__ = [
    "DIRECTIONS",
    "ORDER",
    "Campaign",
    "Complex",
    "Condition",
    "ConvergenceError",
    "Densities",
    "Dof",
    "Estimator",
    "Frf",
    "FrfEstimate",
    "HasPoles",
    "Hit",
    "HitEstimate",
    "Input",
    "InputError",
    "Integers",
    "Layout",
    "Mask",
    "ModalModel",
    "Motor",
    "Quantity",
    "Real",
    "Records",
    "Rejected",
    "Test",
    "Tolerance",
    "UsageError",
    "VarianceSource",
    "WorkbenchError",
    "distinct",
    "drive_point_scale",
    "frozen",
    "is_hammer",
    "modal_sum",
    "node_of",
]
