"""Fixtures of the small machine."""

from small_machine import campaign, drawing, flip, model, true_theta

__all__ = ["campaign", "drawing", "flip", "model", "true_theta"]
