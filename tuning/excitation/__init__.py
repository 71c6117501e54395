"""Signals for a machine's drives: optimal power over lines, phases, and what they will show."""
