"""Fixtures of the small machine."""

from small_machine import drawing, flip, model, true_theta

__all__ = ["drawing", "flip", "model", "true_theta"]
