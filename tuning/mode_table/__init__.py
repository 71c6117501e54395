"""Tuning of a model to a table of modes without shapes."""
