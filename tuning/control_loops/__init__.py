"""Control loops of a campaign: their tables, the check of their stability, a file."""
