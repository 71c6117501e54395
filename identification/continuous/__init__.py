"""FRFs from forces that never rest: random, bursts, multisines, chirps, sweeps, one or several."""

from identification.continuous.estimate import (
    ContinuousEstimate,
    estimate_continuous_frf,
)
from identification.continuous.held_command import remove_hold
from identification.continuous.period_leakage import leakage_noise_factor

__all__ = ["ContinuousEstimate", "estimate_continuous_frf", "leakage_noise_factor", "remove_hold"]
