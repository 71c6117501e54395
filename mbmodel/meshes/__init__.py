"""Meshes: files, closed surfaces, mass properties."""
