"""Fits in stages from several starts, and their checkpoints."""
