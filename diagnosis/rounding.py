"""Shares of a whole that count as nothing."""

import numpy as np

# Rounding errors of a calculation, and what keeps a factor positive: half of the digits.
HALF_PRECISION = float(np.sqrt(np.finfo(float).eps))
NEGLIGIBLE_SHARE = 1e-6  # a curvature, slope, mass or probability that is none
