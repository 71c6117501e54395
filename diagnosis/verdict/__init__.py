"""Verdict of a diagnosis: established causes, rest, and verdict.json."""
