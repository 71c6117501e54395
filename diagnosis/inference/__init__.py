"""From evidence to calibrated posterior probabilities."""
