"""A mount's resonance from the other channels: they tell what a channel should have read.

With x from all other channels and their errors, a channel on a mount reads y = h R x with
h = (1 + i b f) / (1 + i b f - a f^2), a = 1 / f0^2, b = 2 z / f0, so that
y a f^2 - i b f (y - R x) = y - R x is linear in a and b. A coarse scan can miss a resonance in the
band; this does not.
"""

import numpy as np

from identification.solid.rigid_fit import project
from identification.solid.sensor_faults import State
from identification.solid.shared_shape import Shape

_DAMPINGS = (2e-3, 1.0)


def mount_of(state: State, left_out: Shape, channel: int) -> tuple[float, float] | None:
    """Frequency [Hz] and damping by least squares, or None if it is no resonance.

    Args:
        state: what is believed.
        left_out: the fit with the channel left to itself.
        channel: which.
    """
    model, freq = left_out.model, state.data.freq_hz
    rows = model.rows(left_out.fitted.errors) * model.scale[:, None]
    known, wanted = [], []
    for column, mask in enumerate(state.data.measured):
        if mask[channel]:
            white = state.data.white[column] / state.reading
            motion = white @ project(rows, mask).inverse[:6].T
            read = white[:, channel]
            beyond = read - motion @ rows[channel, :6]
            known.append(np.column_stack([read * freq**2, -1j * beyond * freq]))
            wanted.append(beyond)
    if not known:
        return None
    table, right = np.vstack(known), np.concatenate(wanted)
    real = np.vstack([table.real, table.imag])
    square, linear = np.linalg.lstsq(real, np.concatenate([right.real, right.imag]), rcond=None)[0]
    if square <= 0 or linear <= 0:
        return None
    frequency = float(1 / np.sqrt(square))
    return frequency, float(np.clip(0.5 * linear * frequency, *_DAMPINGS))
