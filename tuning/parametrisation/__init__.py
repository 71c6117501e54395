"""Parameters that vary, their coordinates, and what the user specifies about them."""
