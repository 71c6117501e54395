"""The variance of measured FRFs, and checks of what counts as noise."""
