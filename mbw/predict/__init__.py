"""``mbw predict``: modes, FRFs and state space of a model, and their page."""
