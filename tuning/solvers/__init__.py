"""Minimisers: a bounded Gauss-Newton method, and NLopt in plain and in whitened coordinates."""
