"""Decisions of a diagnosis: which causes are established, and whether held-out lines agree."""
