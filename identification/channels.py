"""Channels that cannot be what they say: dead, doubled, exchanged with the drive point."""

import numpy as np

from identification.words import Campaign, Dof, Test

_DEAD = 0.1  # coherence below which a channel holds nothing of the hit
_MARGIN = 1.25  # over that of noise alone
_ALIVE = 0.5  # coherence of the others, which shows that the hit itself was good
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


def silent(campaign: Campaign) -> dict[Dof, tuple[float, float]]:
    """Channels that read noise alone whatever is hit.

    Of noise alone n averages give a coherence with the median 1 - 2^(-1 / (n - 1)) (Bendat and
    Piersol, ch. 9): with few averages that is not little.

    Returns:
        By channel: the largest of its median coherences, and what others have.
    """
    known: dict[Dof, list[tuple[float, float, float]]] = {}
    for test in campaign.tests:
        estimate = test.estimate
        if estimate.coherence is None:
            continue
        each = np.median(estimate.coherence[:, :, 0], axis=0)
        still = np.abs(estimate.frf.values[:, :, 0]).max(axis=0) == 0
        others, noise = float(np.median(each)), _coherence_of_noise(estimate.averages)
        for dof, value, none in zip(estimate.frf.outputs, each, still, strict=True):
            if not none:
                known.setdefault(dof.positive, []).append((float(value), others, noise))
    return {
        dof: (max(value for value, _, _ in found), found[0][1])
        for dof, found in known.items()
        if all(value < noise and others > _ALIVE for value, others, noise in found)
    }


def _coherence_of_noise(averages: int | None) -> float:
    """Median coherence below which a channel holds nothing of the hit."""
    if averages is None or averages < 2:
        return _DEAD
    median = 1 - float(np.exp2(-1 / (averages - 1)))
    return max(_DEAD, min(_MARGIN * median, _ALIVE))


def _silent(campaign: Campaign) -> list[str]:
    return [
        f"{dof} reads noise alone in every test, with a coherence of at most {value:.2g} where "
        f"others have {others:.2g}: its cable is off, or nothing moves there"
        for dof, (value, others) in silent(campaign).items()
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
