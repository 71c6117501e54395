"""``mbw identify``: measured modes, their files and page."""
