"""From FRFs to modes: poles, automatic selection, refinement, indicators."""

from identification.modal.campaign_modes import MeasuredFrfs, combine_tests, identify
from identification.modal.circle_fit_method import Circle, circle_fit
from identification.modal.combination_tones import find_combination_tones
from identification.modal.doubtful_modes import find_doubtful_modes
from identification.modal.drive_residues import negative_drive_points, negative_residue_phrase
from identification.modal.half_power_method import (
    half_power_damping,
    least_squares_amplitude,
    peak_amplitude,
    unit_response,
)
from identification.modal.indicators import (
    auto_mac,
    classify_pole_stability,
    cmif,
    comac,
    frac,
    mac,
    mmif,
    mpc,
    mpd,
    pair_shapes,
    signed_comac,
)
from identification.modal.lscf_method import lscf
from identification.modal.mode_selection import IdentifiedModes, identify_modes
from identification.modal.pole_clusters import ModeCriteria
from identification.modal.shape_fit import WeightedFrfs
from identification.modal.shapes import (
    UNIT_MASS,
    BodyShapes,
    ScaledModes,
    real_shapes,
    scale_shapes,
    shapes_at_bodies,
)
from identification.modal.single_mode_checks import SingleModeCheck, check_single_modes
from identification.modal.state_space import modal_state_space
from identification.modal.synthesis import (
    SynthesisError,
    full_matrix_model,
    missing_drive_point_sentence,
    select_reciprocal_modes,
    synthesis_error,
    synthesise_frfs,
)
from identification.modal.user_choices import ModeChoices

__all__ = [
    "UNIT_MASS",
    "BodyShapes",
    "Circle",
    "IdentifiedModes",
    "MeasuredFrfs",
    "ModeChoices",
    "ModeCriteria",
    "ScaledModes",
    "SingleModeCheck",
    "SynthesisError",
    "WeightedFrfs",
    "auto_mac",
    "check_single_modes",
    "circle_fit",
    "classify_pole_stability",
    "cmif",
    "comac",
    "combine_tests",
    "find_combination_tones",
    "find_doubtful_modes",
    "frac",
    "full_matrix_model",
    "half_power_damping",
    "identify",
    "identify_modes",
    "least_squares_amplitude",
    "lscf",
    "mac",
    "missing_drive_point_sentence",
    "mmif",
    "modal_state_space",
    "mpc",
    "mpd",
    "negative_drive_points",
    "negative_residue_phrase",
    "pair_shapes",
    "peak_amplitude",
    "real_shapes",
    "scale_shapes",
    "select_reciprocal_modes",
    "shapes_at_bodies",
    "signed_comac",
    "synthesis_error",
    "synthesise_frfs",
    "unit_response",
]
