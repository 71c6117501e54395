"""Files that a tuning reads and writes."""
