"""Surfaces of a machine for pictures."""
