"""Readings of encoders in a played motion: multiples of the resolution that a campaign states."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from identification import read_settings
from identification.words import Real

_STREAM = 5  # of the random numbers of a seed, of which others play noise


def read_resolutions(source: Path) -> dict[str, float]:
    """Return the steps of encoders that a campaign states, by label; none of an MJCF."""
    if source.suffix != ".toml":
        return {}
    sensors = read_settings(source)[1].sensor
    return {name: table.resolution for name, table in sensors.items() if table.resolution}


def round_readings(motion: Real, steps: Sequence[float], seed: int) -> Real:
    """Return what encoders read of a motion: multiples of their steps.

    Rounding alone would repeat with a signal that repeats, as no record does. Noise of half a step
    to either side goes before it, so that the mean of many readings is the position
    (non-subtractive dither, Wannamaker et al. 2000).

    Args:
        motion: readings without steps; (n_time, n_out).
        steps: of each output; 0 for none.
        seed: of the noise.
    """
    read = np.array(motion)
    random = np.random.default_rng((seed, _STREAM))
    for column, step in enumerate(steps):
        if step:
            noise = random.uniform(-0.5, 0.5, len(read))
            read[:, column] = step * np.round(read[:, column] / step + noise) + 0.0  # no -0
    return read
