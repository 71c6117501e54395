"""The channels of one body over all tests, in units of their noise."""

from dataclasses import dataclass, replace

import numpy as np

from identification.noise.variance import smooth_variance
from identification.solid.sensor_errors import Sensors
from identification.words import Campaign, Complex, Dof, Mask, Real, Test

# What no tolerance describes: cross-axis sensitivity, linearity, the sensor's own size. Below
# this share of a body's motion nothing is said about solidity; it also bounds weights.
FLOOR = 2e-3


@dataclass(frozen=True, eq=False)
class Table:
    """All channels of a campaign, a column per hit that its tests share.

    Args:
        freq_hz: lines [Hz]; (n_freq,).
        channels: along their positive directions; n_channel.
        values: FRFs, zero where not measured; (n_column, n_freq, n_channel).
        variance: E|error|^2; the same shape.
        measured: (n_column, n_channel).
    """

    freq_hz: Real
    channels: tuple[Dof, ...]
    values: Complex
    variance: Real
    measured: Mask


@dataclass(frozen=True, eq=False)
class BodyData:
    """One body's channels: data, their variances, and the scales that make noise one.

    Weights are separable, var = line x channel, so that sums over lines hold all that a fit
    needs. ``noise`` says what remains of the variance after whitening, where it is not.

    Args:
        body: its name.
        sensors: its channels and where they are.
        freq_hz: lines [Hz]; (n_freq,).
        values: FRFs; (n_column, n_freq, n_channel).
        variance: E|error|^2; the same shape.
        measured: (n_column, n_channel).
        white: values over the noise; (n_column, n_freq, n_channel).
        noise: variance over the weights' one, 1 or less where the floor counts; the same shape.
        scale: 1 / channel's part of the noise; (n_channel,).
        line: 1 / line's part of the noise, zero for lines left out; (n_column, n_freq).
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


def gather(campaign: Campaign) -> Table:
    """Join the tests of one reference, level and speed: FRFs are per force, so hits need not agree.

    A test that brings no channel of its own stands beside the others as a column; a channel that
    several set-ups measured is taken from the first.
    """
    channels = campaign.outputs
    columns: list[tuple[object, dict[Dof, tuple[Test, int]]]] = []
    for test in campaign.tests:
        key = (
            test.condition.reference.positive,
            test.condition.level_n,
            test.condition.spindle_speed,
        )
        cells = {
            dof.positive: (test, row)
            for row, dof in enumerate(test.estimate.frf.outputs)
            if test.estimate.measured[row, 0]
        }
        joined = [have for other, have in columns if other == key and cells.keys() - have.keys()]
        if joined:
            joined[0].update({dof: cell for dof, cell in cells.items() if dof not in joined[0]})
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
    return Table(campaign.freq_hz, channels, values, variance, measured)


def body_data(table: Table, campaign: Campaign, body: str) -> BodyData | None:
    """The channels of one body, or None if it has none."""
    layout = campaign.layout
    places = [k for k, dof in enumerate(table.channels) if layout.body_name(dof.point) == body]
    if not places:
        return None
    sensors = Sensors.of(layout, tuple(table.channels[k] for k in places))
    return whitened(
        body,
        sensors,
        table.freq_hz,
        table.values[:, :, places],
        table.variance[:, :, places],
        measured=table.measured[:, places],
    )


def whitened(  # the parts of one table
    body: str, sensors: Sensors, freq_hz: Real, values: Complex, variance: Real, *, measured: Mask
) -> BodyData:
    """Fit var = line x channel in the mean of logarithms and divide the data by it."""
    cells = np.broadcast_to(measured[:, None, :], values.shape)
    power = np.abs(values) ** 2 * cells
    turning = sensors.turning
    motion = np.zeros(values.shape)
    for kind in (turning, ~turning):
        count = np.maximum(cells[:, :, kind].sum(axis=2), 1)
        motion[:, :, kind] = (power[:, :, kind].sum(axis=2) / count)[:, :, None]
    total = np.where(cells, variance + FLOOR**2 * motion, 0.0)
    known = total > 0
    logarithm = np.log(np.where(known, total, 1.0))
    channel = np.zeros(values.shape[2])
    line = np.zeros(values.shape[:2])
    for _ in range(4):
        count = np.maximum(known.sum(axis=2), 1)
        line = ((logarithm - channel) * known).sum(axis=2) / count
        count = np.maximum(known.sum(axis=(0, 1)), 1)
        channel = ((logarithm - line[:, :, None]) * known).sum(axis=(0, 1)) / count
    used = known.sum(axis=2) == cells.sum(axis=2)  # a line with a channel of no weight is left
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


def exchanged(data: BodyData, order: list[int], signs: Real) -> BodyData:
    """The same body if channel k had read what channel ``order[k]`` did, times a sign."""
    return replace(
        data,
        values=data.values[:, :, order] * signs,
        variance=data.variance[:, :, order],
        measured=data.measured[:, order],
        white=data.white[:, :, order] * signs,
        noise=data.noise[:, :, order],
        scale=data.scale[order],
    )
