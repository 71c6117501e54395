"""Predictions of a plant from a tuned model: bands, reduction, loops, margins, error budget."""

from tuning.plant.reduction.control_plant import ControlPlant, make_control_plant
from tuning.plant.reduction.truncation import ReductionMethod, reduce_system
from tuning.plant.uncertainty.frf_bands import AlternativePlants, FrfBands, frf_bands, sample_frfs
from tuning.plant.uncertainty.minimum_phase_bound import bound_magnitudes
from tuning.plant.uncertainty.plant_assembly import assemble_uncertain_plant
from tuning.plant.uncertainty.uncertain_plant import UncertainPlant, measure_lft_error

__all__ = [
    "AlternativePlants",
    "ControlPlant",
    "FrfBands",
    "ReductionMethod",
    "UncertainPlant",
    "assemble_uncertain_plant",
    "bound_magnitudes",
    "frf_bands",
    "make_control_plant",
    "measure_lft_error",
    "reduce_system",
    "sample_frfs",
]
