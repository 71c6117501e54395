"""Verdict of a diagnosis: its causes, what remains, and verdict.json."""
