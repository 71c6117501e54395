"""The gap between model and measurement, by the definitions of the verdict's format.

Each channel c (one output of one test) over the band:

    e_c = ||H_model - H_measured|| / ||H_measured||,   noise_c^2 = sum var / ||H_measured||^2

error and noise are the root mean squares of e_c and noise_c over the channels with
noise_c <= 0.3; excess is the root mean square of e_c / noise_c over all: 1 is a perfect model.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification import reduce_to_bodies
from identification.words import Campaign, Complex, Dof, Real

_QUIET = 0.3


@dataclass(frozen=True, eq=False)
class ChannelGaps:
    """The gap of every channel.

    Args:
        outputs: label of each channel; n_channel.
        tests: number of its test in the campaign; n_channel.
        error: e_c; (n_channel,).
        noise: noise_c; (n_channel,).
    """

    outputs: tuple[Dof, ...]
    tests: tuple[int, ...]
    error: Real
    noise: Real


@dataclass(frozen=True)
class Gap:
    """The gap of a campaign; None where a number does not exist.

    Args:
        error: rms of e_c over quiet channels.
        excess: rms of e_c / noise_c over all channels.
        noise: rms of noise_c over quiet channels.
        channels: how many there are.
        quiet: how many of them have noise_c <= 0.3.
    """

    error: float | None
    excess: float | None
    noise: float | None
    channels: int
    quiet: int


def channel_gaps(predicted: Sequence[Complex], campaign: Campaign) -> ChannelGaps:
    """Compare predictions with measurements, test by test.

    Args:
        predicted: the model's answer to each test in its labels; (n_freq, n_out, 1) each.
        campaign: the measurements; channels that are silent over the band are left out.
    """
    outputs: list[Dof] = []
    tests: list[int] = []
    error, noise = [], []
    for number, (model, test) in enumerate(zip(predicted, campaign.tests, strict=True)):
        estimate = test.estimate
        values = estimate.frf.values
        power = (np.abs(values) ** 2).sum(axis=0)
        for row, column in np.argwhere(estimate.measured & (power > 0)):
            size = power[row, column]
            off = (np.abs(model[:, row, column] - values[:, row, column]) ** 2).sum()
            outputs.append(estimate.frf.outputs[row])
            tests.append(number)
            error.append(np.sqrt(off / size))
            noise.append(np.sqrt(estimate.variance[:, row, column].sum() / size))
    return ChannelGaps(tuple(outputs), tuple(tests), np.array(error), np.array(noise))


def summarise(gaps: ChannelGaps) -> Gap:
    """Sum up the channels."""
    quiet = gaps.noise <= _QUIET
    known = bool(len(gaps.noise)) and bool((gaps.noise > 0).all())
    return Gap(
        error=_rms(gaps.error[quiet]),
        excess=_rms(gaps.error / gaps.noise) if known else None,
        noise=_rms(gaps.noise[quiet]),
        channels=len(gaps.error),
        quiet=int(quiet.sum()),
    )


def gap_at_bodies(answers: Sequence[Complex], campaign: Campaign) -> Gap:
    """The gap of the motions at the centres of mass, as far as channels determine them.

    Args:
        answers: the model's to each test in its labels; (n_freq, n_out, 1) each.
        campaign: the measurements.
    """
    return summarise(channel_gaps(answers_at_bodies(answers, campaign), at_bodies(campaign)))


def answers_at_bodies(answers: Sequence[Complex], campaign: Campaign) -> tuple[Complex, ...]:
    """A model's answers at the sensors, reduced as the measurement is: sensors are off in both."""
    tests = []
    for test, values in zip(campaign.tests, answers, strict=True):
        estimate = test.estimate
        frf = replace(estimate.frf, values=values)
        tests.append(replace(test, estimate=replace(estimate, frf=frf)))
    reduced = at_bodies(replace(campaign, tests=tuple(tests)))
    return tuple(test.estimate.frf.values for test in reduced.tests)


def at_bodies(campaign: Campaign) -> Campaign:
    """The same tests, reduced to the centres of mass (seed, eq. 2.5)."""
    tests = tuple(
        replace(test, estimate=reduce_to_bodies(test.estimate, campaign.layout))
        for test in campaign.tests
    )
    return replace(campaign, tests=tests)


def block_shares(predicted: Sequence[Complex], campaign: Campaign, width: int) -> Real:
    """What part of the squared error each block of lines holds; (n_block,), sum 1 or all zero."""
    lines = np.zeros(len(campaign.freq_hz))
    for model, test in zip(predicted, campaign.tests, strict=True):
        values = test.estimate.frf.values
        power = (np.abs(values) ** 2).sum(axis=0)
        off = np.abs(model - values) ** 2 / np.where(power > 0, power, 1.0)
        lines += (off * (test.estimate.measured & (power > 0))).sum(axis=(1, 2))
    blocks = np.add.reduceat(lines, np.arange(0, len(lines), width))
    total = blocks.sum()
    shares: Real = blocks / total if total > 0 else blocks
    return shares


def _rms(values: Real) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if len(values) else None
