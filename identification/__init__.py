"""Measurements: readers, FRFs from hits, their noise, checks of solid bodies, modal models."""

from identification.band import band_lines, select_band
from identification.campaign_reader import correct_layout, read_campaign
from identification.checks.channels import duplicate_channels, noise_only_channels
from identification.checks.reciprocity import check_reciprocity
from identification.noise.line_independence import lines_are_independent
from identification.noise.repeatability import (
    find_overstated_noise,
    remove_overstated_noise,
)
from identification.noise.variance import coherence_variance, difference_variance, smooth_variance
from identification.readers.campaign_toml import CampaignSettings, read_settings
from identification.readers.layout import read_layout
from identification.solid import (
    FAULT_PHRASES,
    MIN_REDUNDANT_CHANNELS,
    MOUNT_ENDS,
    BodyCheck,
    Fault,
    body_inverse,
    check_bodies,
    delay_response,
    estimate_bending_shape,
    exchange_phrase,
    mount_response,
    reconstruct,
    reduce_to_bodies,
    reduction_covariance,
)

__all__ = [
    "FAULT_PHRASES",
    "MIN_REDUNDANT_CHANNELS",
    "MOUNT_ENDS",
    "BodyCheck",
    "CampaignSettings",
    "Fault",
    "band_lines",
    "body_inverse",
    "check_bodies",
    "check_reciprocity",
    "coherence_variance",
    "correct_layout",
    "delay_response",
    "difference_variance",
    "duplicate_channels",
    "estimate_bending_shape",
    "exchange_phrase",
    "find_overstated_noise",
    "lines_are_independent",
    "mount_response",
    "noise_only_channels",
    "read_campaign",
    "read_layout",
    "read_settings",
    "reconstruct",
    "reduce_to_bodies",
    "reduction_covariance",
    "remove_overstated_noise",
    "select_band",
    "smooth_variance",
]
