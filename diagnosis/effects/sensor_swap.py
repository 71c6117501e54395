"""Two channels that are exchanged, as by their cables: of one sensor, or of two on any bodies.

It is no rotation, but a mirror image. No slope leads to it: the score test frees the gains of the
channels, and of one sensor the transverse sensitivity that both channels have in common, if it has
a tolerance. A refit to the channels exchanged back decides. On a body with redundant channels the
data checks prove an exchange without a model.

Channels of two sensors are proposed if the fit predicts each of them better from the other one's
place (``find_exchanged_pairs``); all channels of both together are the exchange of two sensors.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import combinations

import numpy as np

from diagnosis.corrections import exchange_channels
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.scene_points import list_sensors, list_varying_names
from identification import FAULT_PHRASES
from identification.words import Dof, Real, group_by_key
from tuning import predict
from tuning.checks.export_faults import MAX_LEFT_SHARE

Pair = tuple[Dof, Dof]


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each two translations of a sensor, and for those of two that fit exchanged."""
    varying = list_varying_names(scene)
    outputs = scene.session.campaign.outputs
    measured = {dof.positive for dof in outputs if isinstance(dof, Dof)}
    sites = {dof.point for dof in measured}
    for site in (site for site in list_sensors(scene) if site in sites):
        for axes in combinations("xyz", 2):
            first, second = (Dof(site, f"+t{axis}") for axis in axes)
            cross = f"{site}.cross_{''.join(axes)}"
            if {first, second} <= measured and varying.issuperset(map(_name_gain, (first, second))):
                yield _exchange([(first, second)], site, (cross,) if cross in varying else ())
    by_sites = group_by_key(
        ((first.point, second.point), (first, second))
        for first, second in find_exchanged_pairs(scene)
        if varying.issuperset(map(_name_gain, (first, second)))
    )
    for (lower, upper), pairs in by_sites.items():
        whole = {dof for dof in measured if dof.point in (lower, upper) and not dof.is_rotation}
        is_whole = {dof for pair in pairs for dof in pair} == whole
        if is_whole and all(first.axis == second.axis for first, second in pairs):
            yield _exchange(pairs, f"{lower}+{upper}")
        else:
            for pair in pairs:
                yield _exchange([pair], f"{lower}+{upper}")


def _name_gain(channel: Dof) -> str:
    return f"{channel.point}.gain_{channel.direction[-1]}"


def _exchange(pairs: Sequence[Pair], sites: str, further: tuple[str, ...] = ()) -> Hypothesis:
    """Return the exchange of pairs of channels.

    Args:
        pairs: exchanged channels; several are two whole sensors.
        sites: one sensor, or two with a plus.
        further: coordinates of the score test beside the gains.
    """
    gains = tuple(_name_gain(channel) for pair in pairs for channel in pair)
    directions = "+".join(channel.direction[1:] for channel in pairs[0])
    return Hypothesis(
        "sensor_swap",
        f"sensor:{sites}",
        directions if len(pairs) == 1 else None,
        scored=(*gains, *further),
        correct=partial(exchange_channels, pairs=tuple(pairs)),
    )


def find_exchanged_pairs(scene: Scene) -> list[Pair]:
    """Return translations of two sensors each that fit the model better exchanged.

    With e_ij = sum over tests of ||H_i - P_j||^2 / ||H_i||^2, H measured and P predicted by the fit
    of the scene, the pairs have e_ij + e_ji of at most half of e_ii + e_jj. Each channel is in one
    pair; pairs with the largest decrease come first.

    Args:
        scene: fit from which hypotheses are proposed.
    """
    channels, misfit = _compare_channels(scene)
    unchanged = np.diag(misfit)
    given, left = unchanged[:, None] + unchanged, misfit + misfit.T
    points = np.array([channel.point for channel in channels])
    is_better = (left <= MAX_LEFT_SHARE * given) & (points[:, None] < points)
    rows, columns = np.nonzero(is_better)
    order = np.argsort(-(given - left)[rows, columns], kind="stable")
    used: set[int] = set()
    pairs: list[Pair] = []
    for first, second in zip(rows[order].tolist(), columns[order].tolist(), strict=True):
        if used.isdisjoint((first, second)):
            used |= {first, second}
            pairs.append((channels[first], channels[second]))
    return pairs


def _compare_channels(scene: Scene) -> tuple[list[Dof], Real]:
    """Return the translations that all tests read, and e_ij; (n_channel, n_channel)."""
    tests = scene.session.campaign.tests
    read = [
        {
            dof.positive: row
            for row, dof in enumerate(test.estimate.frf.outputs)
            if isinstance(dof, Dof) and not dof.is_rotation and test.estimate.measured[row, 0]
        }
        for test in tests
    ]
    sites = set(list_sensors(scene))
    channels = [dof for dof in read[0] if dof.point in sites and all(dof in rows for rows in read)]
    misfit = np.zeros((len(channels), len(channels)))
    answers = predict(scene.model, scene.theta, scene.session.campaign)
    for rows, test, answer in zip(read, tests, answers, strict=True):
        chosen = [rows[channel] for channel in channels]
        signs = np.array([test.estimate.frf.outputs[row].sign for row in chosen])
        measured = test.estimate.frf.values[:, chosen, 0] * signs
        predicted = np.asarray(answer)[:, chosen, 0] * signs
        sizes = (np.abs(measured) ** 2).sum(axis=0)[:, None]
        energy = sizes + (np.abs(predicted) ** 2).sum(axis=0)
        energy = energy - 2 * (measured.conj().T @ predicted).real
        misfit += np.divide(energy, sizes, out=np.zeros_like(misfit), where=sizes > 0)
    return channels, misfit


EFFECT = Effect(
    propose,
    noun=FAULT_PHRASES["sensor_swap"],
    means="channels are exchanged: {channel}",
    confirm="knock at {place} along each axis in turn and see which channel answers",
)
