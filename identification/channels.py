"""Channels that cannot be what they say: dead, doubled, exchanged with the drive point."""

import numpy as np

from identification.words import Campaign, Test

_DEAD = 0.1  # coherence below which a channel holds nothing of the hit
_ALIVE = 0.5  # coherence of the others, which shows that the hit itself was good
_SAME = 1e-6  # relative difference below which two channels hold the same numbers


def channel_remarks(campaign: Campaign) -> tuple[str, ...]:
    """One sentence for each channel of a test that cannot be used as it stands.

    A channel is dead that reads zero, or whose coherence is lost on all lines while that of the
    others is good; two that hold the same numbers, but for sign, are one written twice.
    """
    found: dict[str, list[str]] = {}
    for test in campaign.tests:
        for words in (*_dead(test), *_doubled(test)):
            found.setdefault(words, []).append(str(test.condition.reference))
    every = len(campaign.tests)
    return tuple(
        f"{words}, {'in every test' if len(hits) == every else 'hit at ' + ', '.join(hits)}"
        for words, hits in found.items()
    )


def _dead(test: Test) -> list[str]:
    estimate = test.estimate
    outputs, values = estimate.frf.outputs, estimate.frf.values[:, :, 0]
    still = np.abs(values).max(axis=0) == 0
    said = [
        f"{dof} is dead: it reads zero; ignore it, or mend its cable"
        for dof, none in zip(outputs, still, strict=True)
        if none
    ]
    if estimate.coherence is None:
        return said
    known = np.median(estimate.coherence[:, :, 0], axis=0)
    if (known[~still] > _ALIVE).sum() < 0.5 * len(outputs):
        return said
    return said + [
        f"{dof} is dead: its coherence is {value:.2g} where that of the others is "
        f"{np.median(known):.2g}; ignore it, or mend its cable"
        for dof, value, none in zip(outputs, known, still, strict=True)
        if value < _DEAD and not none
    ]


def _doubled(test: Test) -> list[str]:
    frf = test.estimate.frf
    values = frf.values[:, :, 0]
    sizes = np.linalg.norm(values, axis=0)
    scaled = values / np.where(sizes > 0, sizes, 1.0)
    alike = np.triu(1 - np.abs(scaled.conj().T @ scaled) < _SAME, 1)
    alike &= (sizes > 0)[:, None] & (np.abs(sizes[:, None] / np.maximum(sizes, 1e-300) - 1) < _SAME)
    return [
        f"{frf.outputs[one]} and {frf.outputs[other]} hold the same numbers: one is exported twice"
        for one, other in np.argwhere(alike)
    ]
