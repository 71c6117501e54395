r"""Force and exponential windows.

Both force and motion are multiplied by w(t) = exp(-(t - t_0) / tau), t_0 the hit. From
x(t) = int h(u) f(t - u) du, h the response to a unit impulse,

    w(t) x(t) = int [h(u) exp(-u / tau)] [w(t - u) f(t - u)] du

since w(t) = exp(-u / tau) w(t - u). The windowed motion is the windowed force through the system
h(t) exp(-t / tau), whose transform is H(i w + 1/tau): exact, whatever the force, as long as the
block holds all of it (Ewins 2000, ch. 3.7, has the simpler case of an impulse). Were the window on
the responses alone, the force would have to be short against tau. A pole s_r appears at
s_r - 1/tau, which adds 1 / (tau omega) to a damping ratio; the modal fit evaluates s = i w + 1/tau
and has s_r itself.
"""

from collections.abc import Sequence

import numpy as np

from identification.hits.blocks import Blocks
from identification.words import Real

_REACH = 4  # widths of the pulse beside it: ringing of the hammer is force too
_FILTER = 32  # samples beside the pulse, at least: so long a filter against aliases may ring
_LEFT = 0.0005  # of the largest response: below it, what is cut off a block does not count
_CHUNKS = 20  # of a block, whose energies tell how far the response has decayed
_SURE = 3.0  # standard deviations of the noise's share in the last chunk
_MEANT = 0.1  # of the largest peak of all channels: a channel that shows the decay


def force_windows(blocks: Blocks, length_s: float | None) -> Real:
    """One over the pulse with its bounces, cosines down to zero beside it; (n_hit, n_sample).

    It reaches four widths of the pulse beyond the first rise and the last pulse, and at least 32
    samples: both the hammer and the filters against aliases ring, and what is cut off them is an
    error of the FRF. Half of that again it falls. Behind the pulse the length may be stated.

    Args:
        blocks: the hits.
        length_s: from the first rise on [s]; None for the above, 0 for no window.
    """
    n_hit, n_sample = blocks.force.shape
    windows = np.ones((n_hit, n_sample))
    if length_s == 0:
        return windows
    time = np.arange(n_sample)
    for hit, (blow, start) in enumerate(zip(blocks.blows, blocks.starts, strict=True)):
        reach = max(_REACH * blow.main.width, _FILTER)
        first, last = blow.onset - start - reach, blow.end - start + reach
        if length_s is not None:
            last = blow.onset - start + round(length_s * blocks.records.rate_hz)
        beyond = np.maximum(first - time, time - last) / (reach / 2)
        windows[hit] = 0.5 * (1 + np.cos(np.pi * np.clip(beyond, 0.0, 1.0)))
    return windows


def exponential_windows(blocks: Blocks, tau: float) -> Real:
    """exp(-(t - t_0) / tau), or ones where tau is 0; (n_hit, n_sample)."""
    if tau == 0:
        return np.ones_like(blocks.force)
    hit = np.array([b.onset - s for b, s in zip(blocks.blows, blocks.starts, strict=True)])
    time = (np.arange(blocks.force.shape[1]) - hit[:, None]) / blocks.records.rate_hz
    windows: Real = np.exp(-time / tau)
    return windows


def left_over(blocks: Blocks) -> float:
    """Share of the response that is left where the blocks end, of its largest: amplitudes.

    Energies of twenty chunks of a block, each hit's motion over its impulse, y_h. With several
    hits noise leaves no bias in sum over pairs of y_h y_h' = |sum y_h|^2 - sum |y_h|^2; three
    standard deviations of what noise may leave by chance are taken off. The channel that rings
    longest counts, of those that move at least a tenth of the one that moves most (a channel of
    other units, a rotation, may not be the one).
    """
    impulse = blocks.force.sum(axis=1)
    n_hit, n_out, n_sample = blocks.motion.shape
    length = n_sample // _CHUNKS
    motion = blocks.motion[:, :, n_sample - _CHUNKS * length :] / impulse[:, None, None]
    own = (motion**2).sum(axis=0)
    if n_hit > 1:
        energy = (motion.sum(axis=0) ** 2 - own) / (n_hit * (n_hit - 1))
        pairs = n_hit * (n_hit - 1) / 2
        own = own / n_hit
    else:
        energy, pairs = own, 1.0
    chunked = energy.reshape(n_out, _CHUNKS, length).sum(axis=2)
    chance = own.reshape(n_out, _CHUNKS, length).sum(axis=2)[:, -1] / np.sqrt(length * pairs)
    noise = _SURE * chance if n_hit > 1 else _noise(blocks, impulse, length)
    peak = chunked.max(axis=1)
    meant = peak > _MEANT**2 * peak.max()
    share = np.maximum(chunked[:, -1] - noise, 0.0)[meant] / peak[meant]
    return float(np.sqrt(np.clip(share, 0.0, 1.0)).max(initial=0.0))


def _noise(blocks: Blocks, impulse: Real, length: int) -> Real:
    """Most energy that noise has in a chunk of a single hit, over its impulse squared; (n_out,).

    From the mean square before the hit; the variance of a mean square of n values is 2 / n of it.
    """
    blow, start = blocks.blows[0], blocks.starts[0]
    before = blocks.motion[0, :, : max(blow.onset - start - blow.main.width, 0)]
    count = before.shape[1]
    if not count:
        return np.zeros(before.shape[0])
    most = 1 + _SURE * np.sqrt(2 / length + 2 / count)
    noise: Real = most * length * (before**2).mean(axis=1) / impulse[0] ** 2
    return noise


def choose_tau(blocks: Sequence[Blocks], left: Sequence[float]) -> float:
    """Time constant that brings what is left at the end of the blocks down to 0.05 %; 0 if it is.

    exp(-T / tau) left = 0.0005, T from the hit to the end of the block. Below that share the error
    of cutting a block off is below those of sensors (1 % of gain) and nothing is done.

    Args:
        blocks: of every reference of the campaign.
        left: what is left of each (``left_over``).

    Returns:
        tau [s], for all.
    """
    plan, rate = blocks[0].plan, blocks[0].records.rate_hz
    most = max(left)
    if most <= _LEFT:
        return 0.0
    return float((plan.block - plan.pretrigger) / rate / np.log(most / _LEFT))
