"""Refits of all parameters with one hypothesis added."""
