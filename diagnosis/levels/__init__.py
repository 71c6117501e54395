"""Joints whose stiffness and damping change with the level of the hits: friction, gaps, k3."""
