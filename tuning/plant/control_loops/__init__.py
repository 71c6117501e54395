"""Stability margins of control loops from the frequency response of the plant."""
