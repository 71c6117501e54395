"""Virtual hammer tests: cases, protocols, measurements and their files."""
