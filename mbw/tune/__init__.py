"""``mbw tune``: the model fitted, and sections of its report."""
