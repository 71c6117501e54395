"""``mbw tune``: tuning of a model to a measurement, and the sections of its page."""
