"""Reading, checking and writing of MJCF files."""
