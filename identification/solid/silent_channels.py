"""Detection of channels that read only noise, and should by the other channels read only noise."""

from dataclasses import replace

import numpy as np

from identification.solid.body_channels import BodyData, whiten
from identification.solid.projection import project
from identification.solid.sensor_errors import Sensors
from identification.words import Integers, Layout, Mask, Real

_MOTION_RANK_TOLERANCE = 1e-6  # singular value over the largest below which a motion vanishes
_MAX_STILL_POWER = 2.0  # power over that of the noise below which a channel is still


def drop_still_channels(data: BodyData, layout: Layout) -> BodyData:
    """Return the body without its still channels, or with all of them if all are still.

    The motion that noise alone is taken for differs between hypotheses. By chance the residual
    differs by many nats. So such channels show nothing of a fault. A dead channel is not still,
    since by the others it should move. If the others do not determine this, a single channel is
    left out, and its motion stays free.
    """
    is_still = find_still_channels(data)
    if not is_still.any() or is_still.all():
        return data
    kept = np.flatnonzero(~is_still)
    sensors = Sensors.of(
        layout,
        tuple(data.sensors.channels[k] for k in kept),
        has_cross=data.sensors.has_cross,
        has_delays=data.sensors.has_delays,
    )
    if is_still.sum() > 1:
        rows = data.sensors.rows(np.zeros(data.sensors.count))
        sensors = replace(sensors, moving=_remaining_motions(rows, kept))
    return whiten(
        data.body,
        sensors,
        data.freq_hz,
        data.values[:, :, kept],
        data.variance[:, :, kept],
        measured=data.measured[:, kept],
    )


def _remaining_motions(rows: Real, kept: Integers) -> Real:
    """Return the projector onto the motions that remain if the still channels exclude the others.

    These are the motions that the kept channels determine, and those that all channels together do
    not. Lengths are taken in units of the channels' distance from the centre.
    """
    arm = np.sqrt((rows[:, 3:] ** 2).sum() / max((rows[:, :3] ** 2).sum(), 1e-300)) or 1.0
    unit = np.array([1.0] * 3 + [arm] * 3)
    all_rows, kept_rows = rows / unit, rows[kept] / unit
    determined = np.linalg.pinv(kept_rows, rcond=_MOTION_RANK_TOLERANCE) @ kept_rows
    undetermined = np.eye(6) - np.linalg.pinv(all_rows, rcond=_MOTION_RANK_TOLERANCE) @ all_rows
    return np.asarray((determined + undetermined) / unit[:, None] * unit, float)


def find_still_channels(data: BodyData) -> Mask:
    """Return which channels are still; (n_channel,)."""
    rows = data.sensors.rows(np.zeros(data.sensors.count)) * data.scale[:, None]
    power, noise, fitted, fitted_noise = (np.zeros(len(data.scale)) for _ in range(4))
    for column, mask in enumerate(data.measured):
        white = data.white[column]
        noise_of_column = data.noise[column] * (data.line[column] > 0)[:, None]
        rigid = np.diag(mask.astype(float)) - project(rows, mask).residual_projector
        power += (np.abs(white) ** 2).sum(axis=0)
        noise += noise_of_column.sum(axis=0)
        fitted += (np.abs(white @ rigid) ** 2).sum(axis=0)
        fitted_noise += (noise_of_column @ rigid**2).sum(axis=0)
    return np.asarray(
        (power < _MAX_STILL_POWER * noise) & (fitted < _MAX_STILL_POWER * fitted_noise)
    )
