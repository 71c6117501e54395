"""Force and motion in time, thinned out for pictures (seed, fig. 1.5a)."""

from itertools import pairwise

import numpy as np

from identification.hits.blocks import Blocks
from identification.words import Real, SignalTraces

_MAX_POINTS = 1200  # of a curve: as many as a picture has pixels


def record_traces(blocks: Blocks) -> tuple[SignalTraces, SignalTraces]:
    """Return the signals as recorded: the record of the first block, and that block.

    Args:
        blocks: blocks of at least one hit.
    """
    records, record, start = blocks.records, blocks.blows[0].main.record, blocks.starts[0]
    signals = np.vstack([records.force[record], records.motion[record]])
    parts = (slice(0, signals.shape[1]), slice(start, start + blocks.plan.block))
    whole, block = (_traces(signals, part, record, records.rate_hz) for part in parts)
    return whole, block


def _traces(signals: Real, part: slice, record: int, rate_hz: float) -> SignalTraces:
    positions, values = envelope(signals[:, part], _MAX_POINTS)
    time = (part.start + positions) / rate_hz
    return SignalTraces(record + 1, time, values[0], values[1:].T)


def envelope(signals: Real, limit: int) -> tuple[Real, Real]:
    """Thin out signals so that no peak is lost: least and largest value of each interval.

    Both values stand in the order in which they occur. Signals with few samples stay as they are.

    Args:
        signals: samples; (n_signal, n_sample).
        limit: largest number of points, even.

    Returns:
        Positions of the points [samples] (n_point,), and values (n_signal, n_point).
    """
    count = signals.shape[1]
    if count <= limit:
        return np.arange(count, dtype=float), signals
    edges = np.linspace(0, count, limit // 2 + 1).astype(int)
    values = np.empty((len(signals), limit))
    for k, (first, last) in enumerate(pairwise(edges.tolist())):
        interval = signals[:, first:last]
        low, high = interval.min(axis=1), interval.max(axis=1)
        is_falling = interval.argmax(axis=1) < interval.argmin(axis=1)
        values[:, 2 * k] = np.where(is_falling, high, low)
        values[:, 2 * k + 1] = np.where(is_falling, low, high)
    middles = (edges[:-1] + edges[1:]) / 2
    return np.column_stack([edges[:-1], middles]).ravel(), values
