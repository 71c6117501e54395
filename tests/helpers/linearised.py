"""Slopes of a linearised test written out as one matrix."""

import numpy as np


def stack_jacobian(test):
    """Return J of all parameters over the noise of the fitted lines, with the prior beneath it."""
    refit, split = test.refit, test.refit.shared.shape[1]
    each = refit.own.shape[2]
    shape = (2, *refit.deviation.shape)
    full = np.zeros((2 * refit.deviation.size, split + each * len(refit.own)))
    full[:, :split] = refit.shared
    for number, columns in enumerate(refit.own):
        block = np.zeros((*shape, each))
        own = block[:, :, 3 * number : 3 * number + 3]
        block[:, :, 3 * number : 3 * number + 3] = columns.reshape(own.shape)
        full[:, split + each * number : split + each * (number + 1)] = block.reshape(-1, each)
    return np.vstack([np.sqrt(test.scale) * full, np.diag(refit.bounded / np.sqrt(2))])
