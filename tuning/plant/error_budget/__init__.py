"""Dynamic error budget: spectra of disturbances, loops, and the error at a point of interest."""
