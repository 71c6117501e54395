"""Modes of a linear model, their derivatives and energy shares."""
