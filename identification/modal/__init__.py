"""From FRFs to modes: poles, automatic selection, refinement, indicators."""

from identification.modal.campaign_modes import Measured, beside, identify
from identification.modal.circle_fit_method import Circle, circle_fit
from identification.modal.half_power_method import (
    half_power_damping,
    least_squares_amplitude,
    peak_amplitude,
    unit_response,
)
from identification.modal.indicators import (
    auto_mac,
    cmif,
    comac,
    frac,
    mac,
    mmif,
    mpc,
    mpd,
    paired,
    signed_comac,
    stability,
)
from identification.modal.lscf_method import Poles, lscf
from identification.modal.mode_selection import Identified, identify_modes
from identification.modal.pole_clusters import Tolerances
from identification.modal.refinement import Data, ModalFit
from identification.modal.shapes import (
    UNIT_MASS,
    BodyShapes,
    Scaled,
    real_shapes,
    scaled,
    shapes_at_bodies,
)
from identification.modal.single_mode_checks import ClassicalMode, classical_checks
from identification.modal.synthesis import (
    SynthesisError,
    full_matrix,
    reciprocal,
    synthesis_error,
    synthesised,
)
from identification.modal.user_choices import Wishes

__all__ = [
    "UNIT_MASS",
    "BodyShapes",
    "Circle",
    "ClassicalMode",
    "Data",
    "Identified",
    "Measured",
    "ModalFit",
    "Poles",
    "Scaled",
    "SynthesisError",
    "Tolerances",
    "Wishes",
    "auto_mac",
    "beside",
    "circle_fit",
    "classical_checks",
    "cmif",
    "comac",
    "frac",
    "full_matrix",
    "half_power_damping",
    "identify",
    "identify_modes",
    "least_squares_amplitude",
    "lscf",
    "mac",
    "mmif",
    "mpc",
    "mpd",
    "paired",
    "peak_amplitude",
    "real_shapes",
    "reciprocal",
    "scaled",
    "shapes_at_bodies",
    "signed_comac",
    "stability",
    "synthesis_error",
    "synthesised",
    "unit_response",
]
