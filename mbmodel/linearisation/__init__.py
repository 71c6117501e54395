"""Linearisation of an MJCF machine at its static equilibrium.

Functions take the compiled model and its ``data`` at static equilibrium.
"""
