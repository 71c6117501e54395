"""Modes of a machine as animated pictures and videos to paste."""
