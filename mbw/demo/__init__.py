"""``mbw demo``: identification, tuning and diagnosis of the built-in station."""
