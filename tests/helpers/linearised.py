"""Slopes of a linearised test written out as one matrix."""

import numpy as np


def write_out(slopes, shape):
    """Return J of all parameters: a sensor's columns are zero but in its three rows."""
    columns = [slopes.springs, slopes.tolerances]
    for number, errors in enumerate(slopes.of_sensors):
        block = np.zeros((2, *shape, errors.shape[1]))
        rows = block[:, :, 3 * number : 3 * number + 3]
        block[:, :, 3 * number : 3 * number + 3] = errors.reshape(rows.shape)
        columns.append(block.reshape(-1, errors.shape[1]))
    return np.hstack(columns)
