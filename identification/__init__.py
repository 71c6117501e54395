"""The measured side: hits to FRFs, solid bodies, modal model."""

from identification.band import band_lines
from identification.checks.channels import doubled, silent
from identification.noise.line_independence import independent
from identification.noise.repeatability import Unsteady, steadied, unsteady
from identification.noise.variance import coherence_variance, difference_variance, smooth_variance
from identification.readers.campaign import correct_layout, read_campaign
from identification.readers.campaign_toml import CampaignSettings, read_settings
from identification.readers.layout import read_layout
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
