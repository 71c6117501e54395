"""Estimate of a mount's resonance by linear least squares, from the motion of the other channels.

The motion x follows from all other channels and their errors. A channel on a mount reads

    y = h R x,   h = (1 + i b f) / (1 + i b f - a f^2),   a = 1 / f0^2,   b = 2 z / f0

so that y a f^2 - i b f (y - R x) = y - R x is linear in a and b. A coarse scan can miss a resonance
in the band; this estimate does not.
"""

import numpy as np

from identification.solid.sensor_faults import BelievedBody
from identification.solid.shared_shape import FreeShape
from identification.solid.slope_products import project

_MOUNT_DAMPING_LIMITS = (2e-3, 1.0)  # smallest and largest damping ratio of a mount


def estimate_mount(
    state: BelievedBody, left_out: FreeShape, channel: int
) -> tuple[float, float] | None:
    """Estimate frequency [Hz] and damping ratio, or None if the channel has no resonance.

    Args:
        left_out: fit with the readings of the channel left free.
        channel: number of the channel.
    """
    model, freq = left_out.model, state.data.freq_hz
    rows = model.rows(left_out.fitted.errors) * model.scale[:, None]
    reading = state.reading * model.sensors.delay_factor(left_out.fitted.errors, freq)
    columns, targets = [], []
    for column, mask in enumerate(state.data.measured):
        if mask[channel]:
            white = state.data.white[column] / reading
            motion = white @ project(rows, mask).inverse[:6].T
            read = white[:, channel]
            excess = read - motion @ rows[channel, :6]
            columns.append(np.column_stack([read * freq**2, -1j * excess * freq]))
            targets.append(excess)
    if not columns:
        return None
    table, right = np.vstack(columns), np.concatenate(targets)
    real = np.vstack([table.real, table.imag])
    square, linear = np.linalg.lstsq(real, np.concatenate([right.real, right.imag]), rcond=None)[0]
    if square <= 0 or linear <= 0:
        return None
    frequency = float(1 / np.sqrt(square))
    return frequency, float(np.clip(0.5 * linear * frequency, *_MOUNT_DAMPING_LIMITS))
