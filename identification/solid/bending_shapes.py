"""Estimate of a flexible mode of a body: its frequency and the readings of the body's channels.

With P the projector onto readings that no rigid motion of the body gives, all columns h of the
accelerance near the peak have P h = P shape b. So the sum of Re(P h h^H P) over lines and columns
has the shape as its leading eigenvector, real for a lightly damped mode.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from identification.solid.body_channels import body_data, join_tests
from identification.words import DERIVATIVE_ORDER, Campaign, Dof

_ACCELERANCE_ORDER = 2  # power of s in accelerance over receptance
_PEAK_HALF_WIDTH = 0.03  # half-width of the band around the peak, relative to its frequency


@dataclass(frozen=True)
class BendingShape:
    """Estimate of the flexible mode of a body.

    Args:
        frequency: frequency of its highest peak [Hz].
        readings: reading of each channel, scaled such that the largest is one.
    """

    frequency: float
    readings: Mapping[Dof, float]


def estimate_bending_shape(campaign: Campaign, body: str) -> BendingShape | None:
    """Estimate the frequency and the shape of a body's flexible mode.

    Args:
        body: name of a flexible body.

    Returns:
        None if its channels determine no more than a rigid motion.
    """
    data = body_data(join_tests(campaign), campaign, body)
    if data is None:
        return None
    sensors, freq = data.sensors, data.freq_hz
    arms = sensors.arms[sensors.sensor_of]
    rows = np.hstack([sensors.axes, np.cross(arms, sensors.axes)])
    complete = data.measured.all(axis=0) & ~sensors.turning
    rows = rows[complete]
    projector = np.eye(len(rows)) - rows @ np.linalg.pinv(rows)
    if not len(rows) or np.trace(projector) < 0.5:
        return None
    frf = campaign.tests[0].estimate.frf
    derivative = (2 * np.pi * freq) ** (_ACCELERANCE_ORDER - DERIVATIVE_ORDER[frf.quantity])
    flexible = data.values[:, :, complete] * derivative[:, None] @ projector
    peak = float(freq[int((np.abs(flexible) ** 2).sum(axis=(0, 2)).argmax())])
    chosen = np.abs(freq / peak - 1) <= _PEAK_HALF_WIDTH
    peak_values = flexible[:, chosen].reshape(-1, len(rows))
    _, vectors = np.linalg.eigh((peak_values.T @ peak_values.conj()).real)
    shape = vectors[:, -1] / np.abs(vectors[:, -1]).max()
    channels = [
        dof for dof, is_complete in zip(sensors.channels, complete, strict=True) if is_complete
    ]
    return BendingShape(peak, dict(zip(channels, shape.tolist(), strict=True)))
