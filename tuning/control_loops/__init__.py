"""Control loops of a campaign or a budget: their tables, the check of their stability, a file."""
