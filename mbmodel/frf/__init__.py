"""FRFs of a linear model and their exact derivatives."""
