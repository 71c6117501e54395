r"""A first guess of a body's mode: where the machine peaks with it, and what its channels read.

With P the projector onto what no rigid motion of the body gives its channels, all columns h of the
accelerance have P h = P shape b: near the peak the sum of Re(P h h^H P) over lines and columns has
the shape for its leading eigenvector, real as modes of light damping are.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from identification.solid.body_channels import body_data, gather
from identification.words import ORDER, Campaign, Dof

_ACCELERANCE = 2  # the power of s
_NEAR = 0.03  # of the frequency: what counts beside the peak


@dataclass(frozen=True)
class BendingShape:
    """A first guess.

    Args:
        frequency: of its highest peak [Hz].
        readings: of each channel, the largest one.
    """

    frequency: float
    readings: Mapping[Dof, float]


def bending_shape(campaign: Campaign, body: str) -> BendingShape | None:
    """Where a body's mode peaks and what its channels read of it.

    Args:
        campaign: what was measured.
        body: that is known to bend.

    Returns:
        None if its channels determine no more than a rigid motion.
    """
    data = body_data(gather(campaign), campaign, body)
    if data is None:
        return None
    sensors, freq = data.sensors, data.freq_hz
    arms = sensors.arms[sensors.sensor_of]
    rows = np.hstack([sensors.axes, np.cross(arms, sensors.axes)])
    whole = data.measured.all(axis=0) & ~sensors.turning
    rows = rows[whole]
    spare = np.eye(len(rows)) - rows @ np.linalg.pinv(rows)
    if not len(rows) or np.trace(spare) < 0.5:
        return None
    frf = campaign.tests[0].estimate.frf
    rate = (2 * np.pi * freq) ** (_ACCELERANCE - ORDER[frf.quantity])
    bent = data.values[:, :, whole] * rate[:, None] @ spare
    peak = float(freq[int((np.abs(bent) ** 2).sum(axis=(0, 2)).argmax())])
    chosen = np.abs(freq / peak - 1) <= _NEAR
    seen = bent[:, chosen].reshape(-1, len(rows))
    _, vectors = np.linalg.eigh((seen.T @ seen.conj()).real)
    shape = vectors[:, -1] / np.abs(vectors[:, -1]).max()
    channels = [dof for dof, taken in zip(sensors.channels, whole, strict=True) if taken]
    return BendingShape(peak, dict(zip(channels, shape.tolist(), strict=True)))
