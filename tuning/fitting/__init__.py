"""Fits in stages from several starts, with checkpoints."""
