"""Random numbers of each purpose, so that a new purpose leaves the others alone."""

import numpy as np


def stream(seed: int, purpose: str) -> np.random.Generator:
    """Return the random numbers of one purpose: a child of the seed, told apart by the name."""
    sequence = np.random.SeedSequence(seed, spawn_key=tuple(purpose.encode()))
    return np.random.default_rng(sequence)
