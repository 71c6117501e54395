"""Misfit between model and measurement, its weights and its exact derivatives."""
