"""Channels of one body from all tests, whitened by their noise.

Detection of channels that read only noise, and should by the other channels read only noise.
"""

from dataclasses import dataclass, replace

import numpy as np

from identification.noise.variance import smooth_variance
from identification.solid.sensor_errors import Sensors
from identification.solid.slope_products import project
from identification.words import Campaign, Complex, Dof, Integers, Layout, Mask, Real, Test

# Model-error floor, relative to the motion of the body, for errors that no tolerance describes:
# nonlinearity, the size of a sensor. It also bounds the weights.
MODEL_ERROR_FLOOR = 2e-3


@dataclass(frozen=True, eq=False)
class ChannelTable:
    """All channels of a campaign, one column for each excitation that its tests share.

    Args:
        freq_hz: frequency lines [Hz]; (n_freq,).
        channels: degrees of freedom along their positive directions; n_channel.
        values: FRFs, zero where not measured; (n_column, n_freq, n_channel).
        variance: E|error|^2; (n_column, n_freq, n_channel).
        measured: whether a channel was measured; (n_column, n_channel).
    """

    freq_hz: Real
    channels: tuple[Dof, ...]
    values: Complex
    variance: Real
    measured: Mask


@dataclass(frozen=True, eq=False)
class BodyData:
    """Channels of one body: FRFs, variances, and the scales that whiten their noise.

    The weights are separable, variance = line x channel, so that sums over lines hold all that a
    fit needs. Where the variance is not separable, ``noise`` holds what remains of it after
    whitening.

    Args:
        body: name of the body.
        sensors: its channels and their places.
        freq_hz: frequency lines [Hz]; (n_freq,).
        values: FRFs; (n_column, n_freq, n_channel).
        variance: E|error|^2; (n_column, n_freq, n_channel).
        measured: whether a channel was measured; (n_column, n_channel).
        white: values over the noise; (n_column, n_freq, n_channel).
        noise: variance over that of the weights, 1 or less where the model-error floor counts;
            (n_column, n_freq, n_channel).
        scale: 1 / the channel's factor of the noise; (n_channel,).
        line: 1 / the line's factor of the noise, zero for lines left out; (n_column, n_freq).
    """

    body: str
    sensors: Sensors
    freq_hz: Real
    values: Complex
    variance: Real
    measured: Mask
    white: Complex
    noise: Real
    scale: Real
    line: Real


def join_tests(campaign: Campaign) -> ChannelTable:
    """Join the tests of one reference, force level and speed in one column.

    FRFs are per force, so that tests with different hits can be joined. A channel that reads zero
    counts as not measured. A test without a new channel becomes a column of its own. If several
    set-ups measured a channel, the first is used.
    """
    channels = tuple(dof for dof in campaign.outputs if isinstance(dof, Dof))
    columns: list[tuple[object, dict[Dof, tuple[Test, int]]]] = []
    for test in campaign.tests:
        key = (
            test.condition.reference.positive,
            test.condition.level_n,
            test.condition.spindle_speed,
            test.condition.instrument if campaign.unknown_gains.hammers else None,
        )
        answers = (test.estimate.measured & ~test.estimate.reads_zero)[:, 0]
        cells = {
            dof.positive: (test, row)
            for row, dof in enumerate(test.estimate.frf.outputs)
            if isinstance(dof, Dof) and answers[row]
        }
        matching = [
            known_cells
            for known_key, known_cells in columns
            if known_key == key and cells.keys() - known_cells.keys()
        ]
        if matching:
            matching[0].update({dof: cell for dof, cell in cells.items() if dof not in matching[0]})
        else:
            columns.append((key, cells))
    shape = (len(columns), len(campaign.freq_hz), len(channels))
    values, variance = np.zeros(shape, complex), np.zeros(shape)
    measured = np.zeros((len(columns), len(channels)), bool)
    smooth = {id(test): smooth_variance(test.estimate)[:, :, 0] for test in campaign.tests}
    for column, (_, cells) in enumerate(columns):
        for dof, (test, row) in cells.items():
            frf, place = test.estimate.frf, channels.index(dof)
            sign = frf.outputs[row].sign * test.condition.reference.sign
            values[column, :, place] = frf.values[:, row, 0] * sign
            variance[column, :, place] = smooth[id(test)][:, row]
            measured[column, place] = True
    return ChannelTable(campaign.freq_hz, channels, values, variance, measured)


def list_dead_channels(campaign: Campaign) -> tuple[Dof, ...]:
    """Return the measured channels that read zero in every test."""
    measured, alive = set(), set()
    for test in campaign.tests:
        estimate = test.estimate
        reads_zero = estimate.reads_zero[:, 0]
        for row, dof in enumerate(estimate.frf.outputs):
            if isinstance(dof, Dof) and estimate.measured[row, 0]:
                measured.add(dof.positive)
                if not reads_zero[row]:
                    alive.add(dof.positive)
    return tuple(dof for dof in campaign.outputs if dof in measured - alive)


def body_data(table: ChannelTable, campaign: Campaign, body: str) -> BodyData | None:
    """Return the measured channels of one body, or None if it has none."""
    layout = campaign.layout
    places = [
        k
        for k, dof in enumerate(table.channels)
        if layout.body_name(dof.point) == body and table.measured[:, k].any()
    ]
    if not places:
        return None
    sensors = Sensors.of(
        layout,
        tuple(table.channels[k] for k in places),
        has_cross=campaign.tolerance.sensor_cross > 0,
        has_delays=campaign.tolerance.sensor_delay > 0,
    )
    return whiten(
        body,
        sensors,
        table.freq_hz,
        table.values[:, :, places],
        table.variance[:, :, places],
        measured=table.measured[:, places],
    )


def whiten(  # the parts of one table
    body: str, sensors: Sensors, freq_hz: Real, values: Complex, variance: Real, *, measured: Mask
) -> BodyData:
    """Fit variance = line x channel to the mean of logarithms, and divide the data by it.

    Args:
        freq_hz: frequency lines [Hz]; (n_freq,).
        values: FRFs; (n_column, n_freq, n_channel).
        variance: E|error|^2; (n_column, n_freq, n_channel).
        measured: whether a channel was measured; (n_column, n_channel).
    """
    cells = np.broadcast_to(measured[:, None, :], values.shape)
    power = np.abs(values) ** 2 * cells
    turning = sensors.turning
    motion = np.zeros(values.shape)
    for kind in (turning, ~turning):
        count = np.maximum(cells[:, :, kind].sum(axis=2), 1)
        motion[:, :, kind] = (power[:, :, kind].sum(axis=2) / count)[:, :, None]
    total = np.where(cells, variance + MODEL_ERROR_FLOOR**2 * motion, 0.0)
    known = total > 0
    logarithm = np.log(np.where(known, total, 1.0))
    channel = np.zeros(values.shape[2])
    line = np.zeros(values.shape[:2])
    for _ in range(4):
        count = np.maximum(known.sum(axis=2), 1)
        line = ((logarithm - channel) * known).sum(axis=2) / count
        count = np.maximum(known.sum(axis=(0, 1)), 1)
        channel = ((logarithm - line[:, :, None]) * known).sum(axis=(0, 1)) / count
    used = known.sum(axis=2) == cells.sum(axis=2)  # a line with a channel of no weight is left out
    weight = np.where(known, np.exp(-line[:, :, None] - channel), 0.0) * used[:, :, None]
    return BodyData(
        body,
        sensors,
        freq_hz,
        values,
        variance,
        measured,
        white=values * np.sqrt(weight),
        noise=variance * weight,
        scale=np.exp(-0.5 * channel),
        line=np.exp(-0.5 * line) * used,
    )


def exchange_channels(data: BodyData, order: list[int], signs: Real) -> BodyData:
    """Return the data in which channel k has the readings of channel ``order[k]``, times a sign.

    Args:
        order: number of the channel whose readings each channel gets; n_channel.
        signs: factor of each channel, 1 or -1; (n_channel,).
    """
    return replace(
        data,
        values=data.values[:, :, order] * signs,
        variance=data.variance[:, :, order],
        measured=data.measured[:, order],
        white=data.white[:, :, order] * signs,
        noise=data.noise[:, :, order],
        scale=data.scale[order],
    )


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
