"""Compliance that rigid stages lack: released directions and bending bodies."""
