"""Minimisers: a bounded Gauss-Newton method, and NLopt."""
