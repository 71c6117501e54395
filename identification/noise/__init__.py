"""Variance of measured FRFs, and checks of the noise that it is computed from."""
