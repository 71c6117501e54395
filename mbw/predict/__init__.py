"""``mbw predict``: modes and frequency responses of a model, and their page."""
