"""Linearisation of an MJCF machine at its static equilibrium."""
