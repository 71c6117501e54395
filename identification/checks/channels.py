"""Channels that cannot be what they say: dead, doubled, exchanged with the drive point."""

from dataclasses import dataclass

import numpy as np

from identification.words import Campaign, Dof, FrfEstimate, Test

_DEAD = 0.1  # coherence below which a channel holds nothing of the hit
_MARGIN = 1.25  # over what noise alone has
_ALIVE = 0.5  # coherence of the others, which shows that the hit itself was good
_LOUD = 10.0  # power over the noise's of the others, likewise
_SAME = 1e-6  # relative difference below which two channels hold the same numbers


def channel_remarks(campaign: Campaign) -> tuple[str, ...]:
    """One sentence for each channel that cannot be used as it stands.

    A channel is dead that reads zero; one whose coherence is lost in every test while that of the
    others is good is dead too, or nothing moves there; two that hold the same numbers, but for
    sign, are one written twice.
    """
    found: dict[str, list[str]] = {}
    for test in campaign.tests:
        for words in (*_dead(test), *_doubled(test)):
            found.setdefault(words, []).append(str(test.condition.reference))
    every = len(campaign.tests)
    return (
        *(
            f"{words}, {'in every test' if len(hits) == every else 'hit at ' + ', '.join(hits)}"
            for words, hits in found.items()
        ),
        *_silent(campaign),
    )


def silent(campaign: Campaign) -> dict[Dof, str]:
    """Channels that read noise alone whatever is hit.

    Of noise alone n averages give a coherence with the median 1 - 2^(-1 / (n - 1)) (Bendat and
    Piersol, ch. 9): with few averages that is not little. Without coherence the power of an FRF
    over the variance of its noise has the mean 1 there. Where the others hear little too, the hit
    was weak and says nothing; one good hit of all is enough.

    Returns:
        By channel, how little it reads and what others do, in words.
    """
    known: dict[Dof, list[_Heard]] = {}
    for test in campaign.tests:
        estimate = test.estimate
        still = np.abs(estimate.frf.values[:, :, 0]).max(axis=0) == 0
        for dof, heard, none in zip(estimate.frf.outputs, _heard(estimate), still, strict=True):
            if not none:
                known.setdefault(dof.positive, []).append(heard)
    return {
        dof: max(good, key=lambda heard: heard.value).words
        for dof, found in known.items()
        if all(heard.nothing for heard in found) and (good := [one for one in found if one.good])
    }


@dataclass(frozen=True)
class _Heard:
    """What a channel of a test reads, and the median of what all read.

    Args:
        value, others: coherence, or power over the noise's.
        noise: below which there is nothing of the hit.
        loud: above which the others show that the hit itself was good.
        unit: what they are.
    """

    value: float
    others: float
    noise: float
    loud: float
    unit: str

    @property
    def nothing(self) -> bool:
        return self.value < self.noise

    @property
    def good(self) -> bool:
        return self.others > self.loud

    @property
    def words(self) -> str:
        return f"{self.unit} of at most {self.value:.2g} where others have {self.others:.2g}"


def _heard(estimate: FrfEstimate) -> list[_Heard]:
    """Of every channel."""
    coherence = estimate.coherence
    if coherence is not None:
        each = np.median(coherence[:, :, 0], axis=0)
        limits = (_coherence_of_noise(estimate.averages), _ALIVE, "a coherence")
    else:
        power, variance = np.abs(estimate.frf.values[:, :, 0]) ** 2, estimate.variance[:, :, 0]
        exact = np.where(power > 0, np.inf, 0.0)  # where nothing is known to be noise
        each = np.divide(power, variance, out=exact, where=variance > 0).mean(axis=0)
        limits = (_MARGIN, _LOUD, "a power over that of its noise")
    others = float(np.median(each))
    return [_Heard(float(value), others, *limits) for value in each]


def _coherence_of_noise(averages: int | None) -> float:
    """Median coherence below which a channel holds nothing of the hit."""
    if averages is None or averages < 2:
        return _DEAD
    median = 1 - float(np.exp2(-1 / (averages - 1)))
    return max(_DEAD, min(_MARGIN * median, _ALIVE))


def _silent(campaign: Campaign) -> list[str]:
    return [
        f"{dof} reads noise alone in every test, with {words}: its cable is off, or nothing moves "
        "there"
        for dof, words in silent(campaign).items()
    ]


def _dead(test: Test) -> list[str]:
    estimate = test.estimate
    outputs, values = estimate.frf.outputs, estimate.frf.values[:, :, 0]
    still = np.abs(values).max(axis=0) == 0
    return [
        f"{dof} is dead: it reads zero; ignore it, or mend its cable"
        for dof, none in zip(outputs, still, strict=True)
        if none
    ]


def doubled(campaign: Campaign) -> frozenset[Dof]:
    """Channels that in every test hold the same numbers as another, but for sign."""
    each = (
        {test.estimate.frf.outputs[k].positive for pair in _pairs(test) for k in pair}
        for test in campaign.tests
    )
    return frozenset(set.intersection(*each))


def _doubled(test: Test) -> list[str]:
    outputs = test.estimate.frf.outputs
    return [
        f"{outputs[one]} and {outputs[other]} hold the same numbers: one is exported twice"
        for one, other in _pairs(test)
    ]


def _pairs(test: Test) -> list[tuple[int, int]]:
    """Places of two channels that hold the same numbers."""
    frf = test.estimate.frf
    values = frf.values[:, :, 0]
    sizes = np.linalg.norm(values, axis=0)
    scaled = values / np.where(sizes > 0, sizes, 1.0)
    alike = np.triu(1 - np.abs(scaled.conj().T @ scaled) < _SAME, 1)
    alike &= (sizes > 0)[:, None] & (np.abs(sizes[:, None] / np.maximum(sizes, 1e-300) - 1) < _SAME)
    return [(int(one), int(other)) for one, other in np.argwhere(alike)]
