"""Compliance that rigid stages lack: released rigid directions and bending modes of bodies."""
