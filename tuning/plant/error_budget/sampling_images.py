r"""Power of an error at the images of sampled loops, beside its budget.

A signal of frequency f makes the held controls of sampled loops move the machine at f + k / T too.
With U the controls per source before their hold, the error has there

    E_k = G_zu(s_k) h(s_k) exp(-s_k tau) U(s),   s_k = s + 2 pi i k / T
    U = -K (1 + G_d K)^-1 (G_yd d + n)

and the mean square over time is the sum over all k. The budget holds k = 0.
"""

import numpy as np

from identification.words import Real, percent_text, sampling_period
from mbmodel import Evaluator, FrfRequest
from tuning.plant.error_budget.budget import ErrorBudget
from tuning.plant.error_budget.closed_loop_states import LoopAliases, held_law
from tuning.plant.error_budget.loop_algebra import loop_gains, measured_rows

# Images on either side that are counted: each further one falls with the plant and the hold.
_IMAGES = (-3, -2, -1, 1, 2, 3)
_MIN_SHARE_OF_RATE = 1e-9  # of the sampling rate: an image that falls on 0 Hz is taken here
_MIN_STATED_SHARE = 0.01  # of the mean square, whose root changes by half of it


def image_shares(budget: ErrorBudget) -> Real:
    """Return the mean square of each error at the images, over that of its budget; (n_error,).

    Args:
        budget: with or without sampled loops.
    """
    definition, ports, lines = budget.definition, budget.ports, budget.linearised
    period = sampling_period(definition.loops)
    if not period:
        return np.zeros(len(definition.errors))
    laplace, frfs = lines.request.laplace, lines.values
    images = LoopAliases.of(lines.model, lines.theta, definition, ports).at(laplace)
    returned = np.eye(len(definition.loops)) + loop_gains(definition, ports, frfs, laplace, images)
    read = measured_rows(definition, ports, laplace) @ (frfs @ ports.disturbances) + ports.noise
    gains = np.stack([loop.controller.sampled_response(laplace) for loop in definition.loops], -1)
    # (1 + G K)^-1 stands before K: u = -K y, y = (1 + G K)^-1 (...)
    controls = -gains[:, :, None] * np.linalg.solve(returned, read)
    power = np.zeros(len(definition.errors))
    for image in _IMAGES:
        freq = budget.freq_hz + image / period
        size = np.maximum(np.abs(freq), _MIN_SHARE_OF_RATE / period)
        request = FrfRequest(size, ports.outputs, ports.inputs, "receptance")
        values = Evaluator(lines.model, request).at(lines.theta).values
        values = np.where((freq < 0)[:, None, None], values.conj(), values)
        shifted = laplace + 2j * np.pi * image / period
        held = np.stack([held_law(loop, shifted) for loop in definition.loops], -1)
        moved = ports.errors @ values @ (ports.controls * held[:, None, :]) @ controls
        scaled = moved * budget.weights[:, None, :]
        power += ((scaled @ definition.coherence) * scaled.conj()).real.sum(axis=(0, 2))
    total = budget.rms**2
    return np.divide(power, total, out=np.zeros_like(power), where=total > 0)


def image_sentences(budget: ErrorBudget) -> list[str]:
    """Return a sentence on each error to which the images of sampled loops add 1 % or more."""
    errors = budget.definition.errors
    return [
        f"Sampling moves {error.name} at other frequencies too: images of the sampling rate add "
        f"{percent_text(share, 3)} to its mean square, which the rms leaves out."
        for error, share in zip(errors, image_shares(budget), strict=True)
        if share >= _MIN_STATED_SHARE
    ]
