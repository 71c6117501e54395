"""From FRFs to modes: poles, automatic selection, refinement, indicators."""

from identification.modal.automatic import Identified, identify_modes
from identification.modal.campaign import Measured, beside, identify
from identification.modal.clusters import Tolerances
from identification.modal.fit import Data, ModalFit
from identification.modal.indicators import (
    auto_mac,
    cmif,
    comac,
    mac,
    mmif,
    mpc,
    mpd,
    paired,
    signed_comac,
    stability,
)
from identification.modal.lscf import Poles, lscf
from identification.modal.shapes import (
    UNIT_MASS,
    BodyShapes,
    Scaled,
    real_shapes,
    scaled,
    shapes_at_bodies,
)
from identification.modal.synthesis import (
    SynthesisError,
    exchanged,
    full_matrix,
    reciprocal,
    synthesis_error,
    synthesised,
)
from identification.modal.wishes import Wishes

__all__ = [
    "UNIT_MASS",
    "BodyShapes",
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
    "cmif",
    "comac",
    "exchanged",
    "full_matrix",
    "identify",
    "identify_modes",
    "lscf",
    "mac",
    "mmif",
    "mpc",
    "mpd",
    "paired",
    "real_shapes",
    "reciprocal",
    "scaled",
    "shapes_at_bodies",
    "signed_comac",
    "stability",
    "synthesis_error",
    "synthesised",
]
