"""``mbw models``: which models of a folder have a linear model, and why others have none."""
