"""Ports of a model: what goes in and comes out, their rows, units and requests."""
