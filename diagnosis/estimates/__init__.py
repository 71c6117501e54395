"""Estimates that the verdict states: held-out gap, intervals, shares of the residual."""
