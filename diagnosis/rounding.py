"""Shares of a whole that count as nothing."""

ROUNDING_SHARE = 1e-9  # rounding errors of a calculation, and what keeps a factor positive
NEGLIGIBLE_SHARE = 1e-6  # a curvature, slope, mass or probability that is none
