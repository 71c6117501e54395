"""Check of channels: which read zero, noise alone, or the numbers of another channel."""

from dataclasses import dataclass

import numpy as np

from identification.words import Campaign, FrfEstimate, Output, Test, group_by_key

_MAX_DEAD_COHERENCE = 0.1  # coherence below which a channel holds no response to the hit
_NOISE_MARGIN = 1.25  # factor on the coherence or power ratio of noise alone
# Median over channels that shows that the hit was good, of coherence and of power over noise.
_MIN_GOOD_COHERENCE, _MIN_GOOD_POWER_RATIO = 0.5, 10.0
_MAX_EQUAL_DIFFERENCE = 1e-6  # relative difference below which two channels hold the same numbers
_TINY_SIZE = 1e-300  # avoids a division by zero


def channel_remarks(campaign: Campaign) -> tuple[str, ...]:
    """Return one sentence for each channel that should not be used.

    Such channels read zero, read noise alone in every test, or hold the numbers of another channel
    up to their sign.
    """
    faults = group_by_key(
        (fault, str(test.condition.reference))
        for test in campaign.tests
        for fault in (*_describe_dead(test), *_describe_duplicates(test))
    )
    n_test = len(campaign.tests)
    return (
        *(
            f"{fact} {'in every test' if len(hits) == n_test else 'if hit at ' + ', '.join(hits)}: "
            f"{advice}"
            for (fact, advice), hits in faults.items()
        ),
        *_describe_noise_only(campaign),
    )


def noise_only_channels(campaign: Campaign) -> dict[Output, str]:
    """Find channels that read noise alone in every test.

    Without coherence the measure is the power of the FRF over the variance of its noise, which has
    the mean 1 for noise alone. A test counts as good if the median over channels is high; at least
    one good test is needed, since in a weak one all channels read noise.

    Returns:
        For each such channel, its measure and that of the other channels, as part of a sentence.
    """
    levels = group_by_key(
        (dof.positive, level)
        for estimate in (test.estimate for test in campaign.tests)
        for dof, level, zero in zip(
            estimate.frf.outputs, _signal_levels(estimate), estimate.reads_zero[:, 0], strict=True
        )
        if not zero
    )
    return {
        dof: max(good, key=lambda level: level.value).description
        for dof, of_tests in levels.items()
        if all(level.is_noise for level in of_tests)
        and (good := [level for level in of_tests if level.is_good_test])
    }


def noise_only_rows(estimate: FrfEstimate, margin: float = 1.0) -> list[int]:
    """Return the channels of a good test that read noise alone in it, but not zero.

    Args:
        estimate: FRFs of one test.
        margin: factor on the largest measure of noise, above 1 where other evidence must follow.
    """
    levels = zip(_signal_levels(estimate), estimate.reads_zero[:, 0], strict=True)
    return [
        row
        for row, (level, is_zero) in enumerate(levels)
        if level.value <= margin * level.max_noise and level.is_good_test and not is_zero
    ]


@dataclass(frozen=True)
class _SignalLevel:
    """Measure of the signal of a channel in one test, and its median over channels.

    Args:
        value: coherence of the channel, or its power over that of its noise.
        median: median of this measure over all channels.
        max_noise: value below which the channel holds no response to the hit.
        min_good: median above which the hit was good.
        measure: name of the measure, with its article.
    """

    value: float
    median: float
    max_noise: float
    min_good: float
    measure: str

    @property
    def is_noise(self) -> bool:
        """Whether the channel holds no response to the hit."""
        return self.value < self.max_noise

    @property
    def is_good_test(self) -> bool:
        """Whether the hit was good, by the median over channels."""
        return self.median > self.min_good

    @property
    def description(self) -> str:
        """Measure of the channel and of the other channels, as part of a sentence."""
        return f"{self.measure} of at most {self.value:.2g} where others have {self.median:.2g}"


def _signal_levels(estimate: FrfEstimate) -> list[_SignalLevel]:
    """Return the signal level of every channel."""
    coherence = estimate.coherence
    if coherence is not None and estimate.variance_source != "differences":
        values = np.median(coherence[:, :, 0], axis=0)
        limits = (_coherence_of_noise(estimate.averages), _MIN_GOOD_COHERENCE, "a coherence")
    else:
        power, variance = np.abs(estimate.frf.values[:, :, 0]) ** 2, estimate.variance[:, :, 0]
        exact = np.where(power > 0, np.inf, 0.0)  # where no noise is known
        values = np.divide(power, variance, out=exact, where=variance > 0).mean(axis=0)
        limits = (_NOISE_MARGIN, _MIN_GOOD_POWER_RATIO, "a power over that of its noise")
    median = float(np.median(values))
    return [_SignalLevel(float(value), median, *limits) for value in values]


def _coherence_of_noise(averages: int | None) -> float:
    """Return the median coherence below which a channel holds no response to the hit.

    For noise alone, the coherence from n averages has the median 1 - 2^(-1 / (n - 1)) (Bendat and
    Piersol 2010, ch. 9), which is not small for few averages.
    """
    if averages is None or averages < 2:
        return _MAX_DEAD_COHERENCE
    median = 1 - float(np.exp2(-1 / (averages - 1)))
    return max(_MAX_DEAD_COHERENCE, min(_NOISE_MARGIN * median, _MIN_GOOD_COHERENCE))


def _describe_noise_only(campaign: Campaign) -> list[str]:
    """Return one sentence for each channel that reads noise alone."""
    return [
        f"{dof} reads noise alone in every test, with {level}: its cable is off, or nothing moves "
        "there"
        for dof, level in noise_only_channels(campaign).items()
    ]


def _describe_dead(test: Test) -> list[tuple[str, str]]:
    """Return fact and advice for each channel of a test that reads zero."""
    estimate = test.estimate
    return [
        (f"{dof} is dead and reads zero", "ignore it, or repair its cable")
        for dof, zero in zip(estimate.frf.outputs, estimate.reads_zero[:, 0], strict=True)
        if zero
    ]


def duplicate_channels(campaign: Campaign) -> frozenset[Output]:
    """Find channels that hold the numbers of another channel, up to their sign, in every test."""
    of_tests = (
        {test.estimate.frf.outputs[k].positive for pair in _equal_pairs(test) for k in pair}
        for test in campaign.tests
    )
    return frozenset(set.intersection(*of_tests))


def _describe_duplicates(test: Test) -> list[tuple[str, str]]:
    """Return fact and advice for each pair of channels of a test with equal numbers."""
    outputs = test.estimate.frf.outputs
    return [
        (f"{outputs[first]} and {outputs[second]} hold the same numbers", "one is exported twice")
        for first, second in _equal_pairs(test)
    ]


def _equal_pairs(test: Test) -> list[tuple[int, int]]:
    """Return the index pairs of channels that hold the same numbers, up to their sign."""
    frf = test.estimate.frf
    values = frf.values[:, :, 0]
    sizes = np.linalg.norm(values, axis=0)
    scaled = values / np.where(sizes > 0, sizes, 1.0)
    is_equal = np.triu(1 - np.abs(scaled.conj().T @ scaled) < _MAX_EQUAL_DIFFERENCE, 1)
    size_difference = np.abs(sizes[:, None] / np.maximum(sizes, _TINY_SIZE) - 1)
    is_equal &= (sizes > 0)[:, None] & (size_difference < _MAX_EQUAL_DIFFERENCE)
    return [(int(first), int(second)) for first, second in np.argwhere(is_equal)]
