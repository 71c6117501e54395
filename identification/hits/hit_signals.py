"""Each hit's own signals: channels that die during a test, hum in the force, coarse converters."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identification.hits.blocks import Blocks
from identification.hits.detection import Blow
from identification.words import Mask, Output, Real, Records

_MAX_BROKEN_GAIN = 0.1  # of the channel's largest motion per force: less is no scatter of the aim
_MIN_ALIVE_GAIN = 0.5  # median over the other channels, which shows that the hit was good
_MIN_MOTION_TO_NOISE = 10.0  # of energies: a tenth of the motion is then told from none
_MIN_QUIET_SAMPLES = 16  # before a hit, for the noise of the motion
_MAX_LOST_HITS = 0.5  # of the hits: with more of them dead, the channel is left out instead
_MAINS_HZ = (50.0, 60.0)
_MIN_HUM_SHARE = 0.5  # of the power of the force beside the hits
_RIVAL_FREQUENCIES = (0.7, 0.85, 1.18, 1.43)  # of mains: slow drift and noise explain these as well
_MIN_HUM_PERIODS = 3.0
_MIN_HUM_MOMENTUM = 0.01  # of that of the hit, within the force window: an error of 1 % of an FRF
_HUM_FREE_WIDTHS = 8  # pulse widths after a hit in which hammer and filters ring
# Steps of a converter of 8 bits, and some more for offsets; fewer steps of a better converter whose
# range is set too wide act alike.
_MAX_COARSE_STEPS = 300
_MIN_SAMPLES_PER_STEP = 4.0  # so that few values are no matter of few samples


def find_dead_channels(blocks: Blocks) -> tuple[Mask, Mask]:
    """Find channels that die, and hits without them.

    A channel is dead in a hit if its motion per force is below a tenth of its largest, while the
    median of the other channels keeps half of theirs. The motion that its largest would give must
    stand above what the channel read before the hit, noise or ringing.

    Returns:
        Which hits have a dead channel that is alive in at least half of the hits (n_hit,), and
        which channels are dead in more hits (n_out,).
    """
    force = np.sqrt((blocks.force**2).sum(axis=1))
    energy, before = _energy_and_noise(blocks)
    gain = np.sqrt(np.maximum(energy - before, 0.0)) / np.maximum(force, 1e-300)[:, None]
    largest = gain.max(axis=0, initial=0.0)
    is_shown = (largest * force[:, None]) ** 2 > _MIN_MOTION_TO_NOISE * before
    relative = gain / np.where(largest > 0, largest, 1.0)
    n_out = relative.shape[1]
    dead = np.zeros(relative.shape, bool)
    for channel in range(n_out):
        companions = np.delete(relative, channel, axis=1)
        if companions.size and largest[channel] > 0:
            alive = np.median(companions, axis=1) > _MIN_ALIVE_GAIN
            dead[:, channel] = (relative[:, channel] < _MAX_BROKEN_GAIN) & alive
    dead &= is_shown
    is_lost = np.asarray(dead.sum(axis=0) > _MAX_LOST_HITS * len(dead))
    return np.asarray(dead[:, ~is_lost].any(axis=1)), is_lost


def _energy_and_noise(blocks: Blocks) -> tuple[Real, Real]:
    """Return the energy of each block and channel, and that of its noise; (n_hit, n_out) each.

    The noise is what the channel reads before the hit, over the whole block.
    """
    energy: Real = (blocks.motion**2).sum(axis=2)
    noise = np.zeros_like(energy)
    for hit, (blow, start) in enumerate(zip(blocks.blows, blocks.starts, strict=True)):
        quiet = blow.onset - start - blow.main.width
        if quiet >= _MIN_QUIET_SAMPLES:
            noise[hit] = blocks.motion[hit, :, :quiet].var(axis=1) * blocks.motion.shape[2]
    return energy, noise


def leave_out_dying_channels(blocks: Blocks) -> tuple[Blocks, tuple[str, ...]]:
    """Return the blocks without channels that are dead in most hits, and sentences on them."""
    if len(blocks.blows) < 2 or len(blocks.records.outputs) < 2:
        return blocks, ()
    _, is_lost = find_dead_channels(blocks)
    if not is_lost.any():
        return blocks, ()
    outputs = [dof for dof, lost in zip(blocks.records.outputs, is_lost, strict=True) if lost]
    kept = replace(
        blocks, records=blocks.records.select_channels(~is_lost), motion=blocks.motion[:, ~is_lost]
    )
    names = ", ".join(map(str, outputs))
    return kept, (
        f"{names} {'is' if len(outputs) == 1 else 'are'} dead in most of the hits, though not in "
        "all: a cable broke during the test; left out here",
    )


def find_hum(records: Records, blows: Sequence[Blow], force_window_s: float) -> str | None:
    """Return the mains hum of the force beside the hits as part of a sentence, or None.

    A sine at the frequency of the mains must explain most of the force beside the hits, and more
    than its neighbours do.

    Args:
        blows: hits.
        force_window_s: time in which the force of a hit is kept [s].
    """
    rest = _rest_of_force(records, blows)
    peak = float(np.median([abs(blow.main.height) for blow in blows]))
    width = float(np.median([blow.main.width for blow in blows])) / records.rate_hz
    for mains in _MAINS_HZ:
        if max(map(len, rest), default=0) < _MIN_HUM_PERIODS * records.rate_hz / mains:
            continue
        share, amplitude = _sine_share(rest, mains, records.rate_hz)
        rivals = [_sine_share(rest, mains * r, records.rate_hz)[0] for r in _RIVAL_FREQUENCIES]
        momentum = amplitude * max(min(force_window_s, 0.5 / mains), width) / (peak * width)
        if share > _MIN_HUM_SHARE and share > 2 * max(rivals) and momentum > _MIN_HUM_MOMENTUM:
            return (
                f"the force holds hum of {mains:g} Hz, whose amplitude is {amplitude / peak:.2g} "
                "times the median peak of the hits"
            )
    return None


def _rest_of_force(records: Records, blows: Sequence[Blow]) -> list[Real]:
    """Return the longest part of the force without hits of each record."""
    rest = []
    for number, force in enumerate(records.force):
        ends = [0]
        starts = []
        for blow in blows:
            if blow.main.record == number:
                starts.append(blow.onset - blow.main.width)
                ends.append(blow.end + _HUM_FREE_WIDTHS * blow.main.width)
        parts = [
            force[start:stop]
            for start, stop in zip(ends, [*starts, len(force)], strict=True)
            if stop > start
        ]
        if parts:
            rest.append(max(parts, key=len))
    return rest


def _sine_share(parts: Sequence[Real], frequency: float, rate_hz: float) -> tuple[float, float]:
    """Return the share of the power that a sine explains, and its largest amplitude."""
    explained = total = amplitude = 0.0
    for part in parts:
        level = part - part.mean()
        phase = 2 * np.pi * frequency * np.arange(len(part)) / rate_hz
        basis = np.stack([np.cos(phase), np.sin(phase)], axis=1)
        basis = basis - basis.mean(axis=0)
        weights = np.linalg.lstsq(basis, level, rcond=None)[0]
        explained += float(((basis @ weights) ** 2).sum())
        total += float((level**2).sum())
        amplitude = max(amplitude, float(np.hypot(*weights)))
    return (explained / total if total > 0 else 0.0), amplitude


def find_coarse_channels(blocks: Blocks) -> tuple[tuple[Output | None, int], ...]:
    """Find channels whose samples take few values; the force is None.

    Returns:
        Channel and number of steps over its range.
    """
    records, length = blocks.records, blocks.plan.block
    parts = [
        (blow.main.record, slice(start, start + length))
        for blow, start in zip(blocks.blows, blocks.starts, strict=True)
    ]
    coarse = []
    for channel, output in enumerate((None, *records.outputs)):
        source = records.motion[:, channel - 1] if channel else records.force
        if (first := _count_steps(source[parts[0]])) is None:
            continue
        steps = _count_steps(np.concatenate([source[part] for part in parts]))
        if first and steps is not None:
            coarse.append((output, steps))
    return tuple(coarse)


def _count_steps(values: Real) -> int | None:
    """Return the number of steps over the range of samples; None if they are fine or constant."""
    levels = np.unique(values)
    if len(levels) < 2 or len(levels) * _MIN_SAMPLES_PER_STEP > len(values):
        return None
    steps = (levels[-1] - levels[0]) / np.diff(levels).min()
    return round(float(steps)) if steps <= _MAX_COARSE_STEPS else None


def describe_coarse_channels(
    coarse: Sequence[tuple[Output | None, int]], reference: object
) -> str | None:
    """Return a clause on channels with few steps, or None."""
    if not coarse:
        return None
    names = [f"the force along {reference}" if dof is None else str(dof) for dof, _ in coarse]
    listed = ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
    most = max(steps for _, steps in coarse)
    return (
        f"{listed} resolve{'s' if len(names) == 1 else ''} the whole range of the hits in {most} "
        "steps at most, as from a converter of 8 bits or a range that is far too wide"
    )
