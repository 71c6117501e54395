"""Gap between model and measurement, as the format of the verdict defines it.

For each channel c (one output of one test) over the band:

    e_c = ||H_model - H_measured|| / ||H_measured||,   noise_c^2 = sum var / ||H_measured||^2

``error`` and ``noise`` are the root mean squares of e_c and noise_c over the quiet channels, those
with noise_c <= 0.3. ``excess`` is the root mean square of e_c / noise_c over all channels; it is 1
for a perfect model.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification import reduce_to_bodies
from identification.words import Campaign, Complex, Dof, Integers, Real

MIN_VISIBLE_EXCESS = 1.1  # over the noise; less is next to nothing, in a tuning and in a verdict
MAX_NOISE_RATIO = 0.3  # noise_c of a channel whose error can be told from noise


@dataclass(frozen=True, eq=False)
class ChannelGaps:
    """Gap of every channel.

    Args:
        outputs: label of each channel; n_channel.
        tests: index of each channel's test in the campaign; n_channel.
        error: e_c; (n_channel,).
        noise: noise_c; (n_channel,).
    """

    outputs: tuple[Dof, ...]
    tests: tuple[int, ...]
    error: Real
    noise: Real


@dataclass(frozen=True)
class Gap:
    """Gap of a campaign; None for a number that does not exist.

    Args:
        error: root mean square of e_c over quiet channels.
        excess: root mean square of e_c / noise_c over all channels.
        noise: root mean square of noise_c over quiet channels.
        channels: number of channels.
        quiet: number of channels with noise_c <= 0.3.
    """

    error: float | None
    excess: float | None
    noise: float | None
    channels: int
    quiet: int


def is_gap_visible(gap: float, min_excess: float = MIN_VISIBLE_EXCESS) -> bool:
    """Return whether a gap is more than next to nothing.

    Args:
        gap: mean square of the gap over that of the noise, excess^2 - 1.
        min_excess: excess up to which it is next to nothing.
    """
    return gap > min_excess**2 - 1


def relative_change(changed: Sequence[Complex], predicted: Sequence[Complex]) -> float | None:
    """Return the root mean square over tests of ||H' - H|| / ||H||; None if nothing moves.

    Args:
        changed: H', the model's answer to each test; (n_freq, n_out, 1) each.
        predicted: H, likewise.
    """
    ratios = [
        np.linalg.norm(second - first) / size
        for first, second in zip(predicted, changed, strict=True)
        if (size := float(np.linalg.norm(first))) > 0
    ]
    return float(np.sqrt(np.mean(np.square(ratios)))) if ratios else None


def channel_gaps(predicted: Sequence[Complex], campaign: Campaign) -> ChannelGaps:
    """Compare predictions with measurements, test by test.

    Args:
        predicted: the model's answer to each test in its labels; (n_freq, n_out, 1) each.
        campaign: measurements; channels without any signal in the band are left out.
    """
    outputs: list[Dof] = []
    tests: list[int] = []
    error, noise = [], []
    for number, (model, test) in enumerate(zip(predicted, campaign.tests, strict=True)):
        estimate = test.estimate
        values = estimate.frf.values
        power = (np.abs(values) ** 2).sum(axis=0)
        for row, column in np.argwhere(estimate.measured & (power > 0)):
            channel_power = power[row, column]
            squared_error = (np.abs(model[:, row, column] - values[:, row, column]) ** 2).sum()
            outputs.append(estimate.frf.outputs[row])
            tests.append(number)
            error.append(np.sqrt(squared_error / channel_power))
            noise.append(np.sqrt(estimate.variance[:, row, column].sum() / channel_power))
    return ChannelGaps(tuple(outputs), tuple(tests), np.array(error), np.array(noise))


def summarise_gaps(gaps: ChannelGaps) -> Gap:
    """Summarise the gaps of channels in root mean squares."""
    quiet = gaps.noise <= MAX_NOISE_RATIO
    has_noise = bool(len(gaps.noise)) and bool((gaps.noise > 0).all())
    return Gap(
        error=_rms(gaps.error[quiet]),
        excess=_rms(gaps.error / gaps.noise) if has_noise else None,
        noise=_rms(gaps.noise[quiet]),
        channels=len(gaps.error),
        quiet=int(quiet.sum()),
    )


def gap_at_bodies(predicted: Sequence[Complex], campaign: Campaign) -> Gap:
    """Return the gap of the motions at the centres of mass that the channels determine.

    Args:
        predicted: the model's answer to each test in its labels; (n_freq, n_out, 1) each.
    """
    return summarise_gaps(
        channel_gaps(
            reduce_answers_to_bodies(predicted, campaign), reduce_campaign_to_bodies(campaign)
        )
    )


def reduce_answers_to_bodies(
    predicted: Sequence[Complex], campaign: Campaign
) -> tuple[Complex, ...]:
    """Reduce a model's answers at the sensors to the centres of mass, like the measurement.

    Errors of the sensors thus have equal effect on both.

    Args:
        predicted: the model's answer to each test in its labels; (n_freq, n_out, 1) each.
    """
    tests = []
    for test, values in zip(campaign.tests, predicted, strict=True):
        estimate = test.estimate
        frf = replace(estimate.frf, values=values)
        tests.append(replace(test, estimate=replace(estimate, frf=frf)))
    reduced = reduce_campaign_to_bodies(replace(campaign, tests=tuple(tests)))
    return tuple(test.estimate.frf.values for test in reduced.tests)


def reduce_campaign_to_bodies(campaign: Campaign) -> Campaign:
    """Return the tests reduced to motions at the centres of mass (seed, eq. 2.5)."""
    tests = tuple(
        replace(test, estimate=reduce_to_bodies(test.estimate, campaign.layout))
        for test in campaign.tests
    )
    return replace(campaign, tests=tests)


def block_error_shares(predicted: Sequence[Complex], campaign: Campaign, starts: Integers) -> Real:
    """Return each block's share of the squared error; (n_block,), sum 1 or all zero.

    Args:
        predicted: the model's answer to each test in its labels; (n_freq, n_out, 1) each.
        starts: first line of each block; (n_block,).
    """
    lines = np.zeros(len(campaign.freq_hz))
    for model, test in zip(predicted, campaign.tests, strict=True):
        values = test.estimate.frf.values
        power = (np.abs(values) ** 2).sum(axis=0)
        relative_error = np.abs(model - values) ** 2 / np.where(power > 0, power, 1.0)
        lines += (relative_error * (test.estimate.measured & (power > 0))).sum(axis=(1, 2))
    blocks = np.add.reduceat(lines, starts)
    total = blocks.sum()
    return blocks / total if total > 0 else blocks


def _rms(values: Real) -> float | None:
    """Return the root mean square, None without values."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else None
