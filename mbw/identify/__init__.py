"""``mbw identify``: identification of the measured modes, their files and page."""
