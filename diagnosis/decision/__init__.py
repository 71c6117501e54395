"""What is decided of a diagnosis: its gap is there to be closed, and causes are established."""
