"""The command ``mbw`` with its verbs and pages; the other packages do the computation."""
