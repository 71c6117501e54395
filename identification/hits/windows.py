r"""Force windows and exponential windows.

Force and motion are both multiplied by w(t) = exp(-(t - t_0) / tau), with t_0 the time of the hit.
From x(t) = int h(u) f(t - u) du, with the impulse response ``h``,

    w(t) x(t) = int [h(u) exp(-u / tau)] [w(t - u) f(t - u)] du,

since w(t) = exp(-u / tau) w(t - u). The windowed motion is thus the response of the system
h(t) exp(-t / tau) to the windowed force; the transform of that system is H(i w + 1/tau). This is
exact for any force that the block holds completely (Ewins 2000, ch. 3.7, treats the impulse). A
window on the responses alone would need a force that is short compared with tau. A pole s_r appears
at s_r - 1/tau, which adds 1 / (tau omega) to a damping ratio. The modal fit evaluates
s = i w + 1/tau and so obtains s_r itself.

Exponential windows that the analyser applied before it stored the records.

The noise of a force sensor does not change within a block. Under a window exp(-t / tau) it falls
with 1 / tau, long after the pulse. The responses cannot show a window, since they decay too.
"""

from collections.abc import Sequence

import numpy as np

from identification.hits.blocks import Blocks
from identification.words import Real

_PULSE_WIDTHS_KEPT = 4  # pulse widths beside the pulse: ringing of the hammer is force too
_MIN_SAMPLES_KEPT = 32  # samples beside the pulse: ringing of the anti-aliasing filter
_NEGLIGIBLE_RESPONSE = 0.0005  # of the largest response, at the end of a block
_N_CHUNK = 20  # chunks of a block, whose energies show the decay of the response
_NOISE_DEVIATIONS = 3.0  # standard deviations of the noise in the last chunk, subtracted
_MIN_CHANNEL_PEAK = 0.1  # of the largest peak of all channels, for a channel to count


def force_windows(blocks: Blocks, length_s: float | None) -> Real:
    """Compute the force windows: 1 over the pulse and its bounces, with cosine tapers beside.

    The window is 1 from four pulse widths before the first rise to four after the last pulse, with
    at least 32 samples on each side. Hammer and anti-aliasing filters ring, and ringing that
    is cut off becomes an error of the FRF. The tapers are half as long.

    Args:
        blocks: blocks of the hits.
        length_s: length of the window from the first rise [s]; None for the length above, 0 for
            no window.

    Returns:
        Windows; (n_hit, n_sample).
    """
    n_hit, n_sample = blocks.force.shape
    windows = np.ones((n_hit, n_sample))
    if length_s == 0:
        return windows
    time = np.arange(n_sample)
    for hit, (blow, start) in enumerate(zip(blocks.blows, blocks.starts, strict=True)):
        reach = max(_PULSE_WIDTHS_KEPT * blow.main.width, _MIN_SAMPLES_KEPT)
        first, last = blow.onset - start - reach, blow.end - start + reach
        if length_s is not None:
            last = blow.onset - start + round(length_s * blocks.records.rate_hz)
        beyond = np.maximum(first - time, time - last) / (reach / 2)
        windows[hit] = 0.5 * (1 + np.cos(np.pi * np.clip(beyond, 0.0, 1.0)))
    return windows


def exponential_windows(blocks: Blocks, tau: float) -> Real:
    """Compute the exponential windows exp(-(t - t_0) / tau), or ones if tau is 0.

    Args:
        blocks: blocks of the hits, which give the times t_0.
        tau: time constant [s].

    Returns:
        Windows; (n_hit, n_sample).
    """
    if tau == 0:
        return np.ones_like(blocks.force)
    hit = np.array([b.onset - s for b, s in zip(blocks.blows, blocks.starts, strict=True)])
    time = (np.arange(blocks.force.shape[1]) - hit[:, None]) / blocks.records.rate_hz
    return np.exp(-time / tau)


def residual_response(blocks: Blocks) -> float:
    """Estimate the amplitude of the response at the end of the blocks over its largest amplitude.

    The estimate compares the energies of the last and the strongest of twenty chunks of a block.
    Let y_h be the motion of hit h over its impulse. With several hits the energy is the sum over
    pairs y_h y_h', |sum y_h|^2 - sum |y_h|^2, in which noise leaves no bias. Three standard
    deviations of the noise in it are subtracted. The result is that of the channel that rings
    longest, among those with at least a tenth of the largest peak. Rotations have another unit, so
    this limit may exclude them.
    """
    impulse = blocks.force.sum(axis=1)
    n_hit, n_out, n_sample = blocks.motion.shape
    length = n_sample // _N_CHUNK
    motion = blocks.motion[:, :, n_sample - _N_CHUNK * length :] / impulse[:, None, None]
    squares = (motion**2).sum(axis=0)
    if n_hit > 1:
        energy = (motion.sum(axis=0) ** 2 - squares) / (n_hit * (n_hit - 1))
        pairs = n_hit * (n_hit - 1) / 2
        squares = squares / n_hit
    else:
        energy, pairs = squares, 1.0
    chunked = energy.reshape(n_out, _N_CHUNK, length).sum(axis=2)
    last = squares.reshape(n_out, _N_CHUNK, length).sum(axis=2)[:, -1]
    deviation = last / np.sqrt(length * pairs)
    noise = _NOISE_DEVIATIONS * deviation if n_hit > 1 else _max_noise(blocks, impulse, length)
    peak = chunked.max(axis=1)
    counts = peak > _MIN_CHANNEL_PEAK**2 * peak.max()
    share = np.maximum(chunked[:, -1] - noise, 0.0)[counts] / peak[counts]
    return float(np.sqrt(np.clip(share, 0.0, 1.0)).max(initial=0.0))


def _max_noise(blocks: Blocks, impulse: Real, length: int) -> Real:
    """Return the largest energy of noise in a chunk of a single hit, over its impulse squared.

    It comes from the mean square before the hit. A mean square of n values has the relative
    variance 2 / n.

    Args:
        blocks: block of one hit.
        impulse: impulse of the hit; (1,).
        length: samples of a chunk.

    Returns:
        Energies; (n_out,).
    """
    blow, start = blocks.blows[0], blocks.starts[0]
    before = blocks.motion[0, :, : max(blow.onset - start - blow.main.width, 0)]
    count = before.shape[1]
    if not count:
        return np.zeros(before.shape[0])
    factor = 1 + _NOISE_DEVIATIONS * np.sqrt(2 / length + 2 / count)
    return factor * length * (before**2).mean(axis=1) / impulse[0] ** 2


def choose_tau(length_s: float, residuals: Sequence[float]) -> float:
    """Choose the time constant that reduces the response at the end of the blocks to 0.05 %.

    It solves exp(-T / tau) r = 0.0005, with ``r`` the largest residual response and T the time from
    the hit to the end of the block. Below 0.05 % there is no window: the truncation error is then
    far below those of sensors (1 % of gain).

    Args:
        length_s: T [s].
        residuals: residual response of each reference (``residual_response``).

    Returns:
        Common time constant tau [s]; 0 for no window.
    """
    largest = max(residuals)
    if largest <= _NEGLIGIBLE_RESPONSE:
        return 0.0
    return float(length_s / np.log(largest / _NEGLIGIBLE_RESPONSE))


_N_NOISE_CHUNKS = 12  # chunks of the force after the pulse, whose noise is compared
_MIN_CHUNK_SAMPLES = 24  # samples of a chunk: its rms then scatters by some 10 %
_REACH_WIDTHS = 6  # pulse widths after the pulse that are left out: the hammer rings
_MIN_REACH_SAMPLES = 48  # samples left out at least: anti-aliasing filters ring
_MIN_DECAY_NEPERS = 1.0  # fall of the noise over the block: less can be chance
_MAX_SCATTER_NEPERS = 0.35  # scatter of the logarithms about a straight line


def combine_windows(*taus: float) -> float:
    """Return the time constant of several exponential windows together [s]; 0 for none.

    exp(-t / a) exp(-t / b) = exp(-t (1 / a + 1 / b)).
    """
    decay = sum(1.0 / tau for tau in taus if tau > 0)
    return 1.0 / decay if decay else 0.0


def detect_recorded_window(blocks: Blocks) -> float | None:
    """Estimate the exponential window that the records carry, from the noise of the force.

    The rms of third differences of the force, which offsets and slow drift do not reach, is taken
    in chunks after the pulse, and a straight line is fitted to its logarithm.

    Args:
        blocks: blocks of the hits, before any window of this software.

    Returns:
        Time constant [s]; None where the noise is steady or there is none.
    """
    ends = [
        blow.end - start + max(_REACH_WIDTHS * blow.main.width, _MIN_REACH_SAMPLES)
        for blow, start in zip(blocks.blows, blocks.starts, strict=True)
    ]
    first = max(ends)
    length = (blocks.plan.block - first - 3) // _N_NOISE_CHUNKS
    if length < _MIN_CHUNK_SAMPLES:
        return None
    differences = np.diff(blocks.force[:, first:], 3, axis=1)[:, : _N_NOISE_CHUNKS * length]
    chunks = differences.reshape(len(ends), _N_NOISE_CHUNKS, length)
    power: Real = (chunks**2).mean(axis=(0, 2))
    if not (power > 0).all():
        return None
    log_rms = np.log(power) / 2
    time = np.arange(_N_NOISE_CHUNKS) * length / blocks.records.rate_hz
    slope, level = np.polyfit(time, log_rms, 1)
    scatter = float(np.std(log_rms - slope * time - level))
    is_window = -slope * time[-1] > _MIN_DECAY_NEPERS and scatter < _MAX_SCATTER_NEPERS
    return float(-1.0 / slope) if is_window else None
