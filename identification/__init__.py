"""The measured side: hits to FRFs, solid bodies, modal model."""

from identification.band import band_lines
from identification.campaign import correct_layout, read_campaign
from identification.channels import doubled, silent
from identification.layout_in import read_layout
from identification.neighbours import independent
from identification.settings import CampaignSettings, read_settings
from identification.solid import (
    FAULTS,
    BendingShape,
    BodyCheck,
    Fault,
    bending_shape,
    body_inverse,
    check_bodies,
    delayed,
    mount,
    reconstruct,
    reduce_to_bodies,
)
from identification.steady import Unsteady, steadied, unsteady
from identification.variance import coherence_variance, difference_variance, smooth_variance

__all__ = [
    "FAULTS",
    "BendingShape",
    "BodyCheck",
    "CampaignSettings",
    "Fault",
    "Unsteady",
    "band_lines",
    "bending_shape",
    "body_inverse",
    "check_bodies",
    "coherence_variance",
    "correct_layout",
    "delayed",
    "difference_variance",
    "doubled",
    "independent",
    "mount",
    "read_campaign",
    "read_layout",
    "read_settings",
    "reconstruct",
    "reduce_to_bodies",
    "silent",
    "smooth_variance",
    "steadied",
    "unsteady",
]
