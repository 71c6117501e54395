"""From FRFs to modes: poles, automatic selection, refinement, indicators."""

from identification.modal.automatic import Identified, Tolerances, identify_modes
from identification.modal.campaign import Measured, beside, identify
from identification.modal.fit import Data, ModalFit
from identification.modal.indicators import auto_mac, cmif, comac, mac, mmif, mpc, mpd
from identification.modal.lscf import Poles, lscf

__all__ = [
    "Data",
    "Identified",
    "Measured",
    "ModalFit",
    "Poles",
    "Tolerances",
    "auto_mac",
    "beside",
    "cmif",
    "comac",
    "identify",
    "identify_modes",
    "lscf",
    "mac",
    "mmif",
    "mpc",
    "mpd",
]
