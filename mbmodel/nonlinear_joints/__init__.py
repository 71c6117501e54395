"""Nonlinear joints in MJCF: friction, gaps and polynomial springs, written and read back."""
