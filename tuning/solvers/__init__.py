"""Minimisers: our bounded Gauss-Newton method and NLopt."""
