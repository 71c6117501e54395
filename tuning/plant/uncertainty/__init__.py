"""Uncertainty of a model's FRFs: posterior of its parameters, bands, samples, uncertain plant."""
