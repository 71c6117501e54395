"""Static equilibrium that follows the tuned parameters: hung and preloaded machines."""
