"""Checks of the measurement that need no model."""
