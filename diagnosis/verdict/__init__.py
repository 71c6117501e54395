"""The verdict as a file: its schema and how it is built from a diagnosis."""
