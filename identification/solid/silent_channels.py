"""Channels that neither read nor, by the others, should read more than noise."""

from dataclasses import replace

import numpy as np

from identification.solid.body_channels import BodyData, whitened
from identification.solid.rigid_fit import project
from identification.solid.sensor_errors import Sensors
from identification.words import Integers, Layout, Mask, Real

_RANK = 1e-6  # of the largest singular value
_MOVING = 2.0  # times the noise: power of a channel that moves


def without_still(data: BodyData, layout: Layout) -> BodyData:
    """The body without its still channels; all of them if all are still.

    Of noise alone, which motion it is taken for differs from one hypothesis to the next, and so
    does, by chance and by many nats, what the motion leaves: such channels say nothing of a fault.
    One that is dead is not still, since by the others it should move. Where the others do not
    tell, a single one may be either: it is left out, and its motion stays free.
    """
    still = still_channels(data)
    if not still.any() or still.all():
        return data
    kept = np.flatnonzero(~still)
    sensors = Sensors.of(layout, tuple(data.sensors.channels[k] for k in kept))
    if still.sum() > 1:
        rows = data.sensors.rows(np.zeros(data.sensors.count))
        sensors = replace(sensors, moving=_moving(rows, kept))
    return whitened(
        data.body,
        sensors,
        data.freq_hz,
        data.values[:, :, kept],
        data.variance[:, :, kept],
        measured=data.measured[:, kept],
    )


def _moving(rows: Real, kept: Integers) -> Real:
    """Projector onto the motions that are left where still channels show the others to be none.

    Those that the kept channels determine, and those that all channels together do not. Lengths
    are taken in units of the channels' distance from the centre.
    """
    arm = np.sqrt((rows[:, 3:] ** 2).sum() / max((rows[:, :3] ** 2).sum(), 1e-300)) or 1.0
    unit = np.array([1.0] * 3 + [arm] * 3)
    every, own = rows / unit, rows[kept] / unit
    seen = np.linalg.pinv(own, rcond=_RANK) @ own
    hidden = np.eye(6) - np.linalg.pinv(every, rcond=_RANK) @ every
    return np.asarray((seen + hidden) / unit[:, None] * unit, float)


def still_channels(data: BodyData) -> Mask:
    """Which channels are still; (n_channel,)."""
    rows = data.sensors.rows(np.zeros(data.sensors.count)) * data.scale[:, None]
    power, noise, fitted, fitted_noise = (np.zeros(len(data.scale)) for _ in range(4))
    for column, mask in enumerate(data.measured):
        white = data.white[column]
        own = data.noise[column] * (data.line[column] > 0)[:, None]
        rigid = np.diag(mask.astype(float)) - project(rows, mask).spare
        power += (np.abs(white) ** 2).sum(axis=0)
        noise += own.sum(axis=0)
        fitted += (np.abs(white @ rigid) ** 2).sum(axis=0)
        fitted_noise += (own @ rigid**2).sum(axis=0)
    return np.asarray((power < _MOVING * noise) & (fitted < _MOVING * fitted_noise))
