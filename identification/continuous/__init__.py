"""FRFs from forces that never rest: random, bursts, multisines, chirps, sweeps, one or several."""

from identification.continuous.estimate import (
    ContinuousEstimate,
    estimate_continuous_frf,
)
from identification.continuous.held_command import remove_hold

__all__ = ["ContinuousEstimate", "estimate_continuous_frf", "remove_hold"]
