"""MJCF files: compiled, checked and written."""
