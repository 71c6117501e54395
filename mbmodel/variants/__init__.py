"""Variants of a machine: with a known mass, or with a stage elsewhere, sharing all parameters."""
