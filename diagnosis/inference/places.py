r"""Places of a gap: those of its causes, and where an unknown force may act.

A test may not show at which of two places an effect acts: whether a link ends at either of two
bodies that a stiff joint joins. Such places are one cause. Let d be what the refit of a set takes
off the gap of the refit without the cause, everything else tuned anew in both. Two places of one
effect are interchangeable if d at the one and d' at the other, beside the same causes, have

    cos = Re(d^H W d') / (|d| |d'|) >= 0.95,

W being the weights of the better fit. They are one cause if also the most probable set with either
is within 3 nats of that with the other, and holds not both. In a group this is so for every pair.
The probability of a group is that of all sets with one of its places, each of which has paid the
prior of its place.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import softmax

from diagnosis.inference.calibration import Calibration, load_calibration
from diagnosis.inference.evidence import Evidence, ForceGain, Key, Site, read_site
from diagnosis.settings import NEGLIGIBLE_SHARE, DiagnosisSettings

Keys = tuple[Key, ...]
Shares = tuple[tuple[Key, float], ...]
Group = tuple[Site, ...]  # one effect at places that the test cannot tell apart


def group_places(
    sets: Mapping[Keys, float], interchangeable: Sequence[tuple[Site, Site]], nats: float
) -> list[Group]:
    """Return causes, each with its places that the test cannot tell apart, the likeliest first.

    Args:
        sets: probabilities of sets of causes.
        interchangeable: pairs of places whose refits take the same off the gap.
        nats: difference in log probability up to which two places are one cause.
    """
    ordered = sorted(sets, key=lambda keys: -sets[keys])
    leading: dict[Site, frozenset[Site]] = {}  # the most probable set of each place
    most: dict[Site, float] = {}
    for keys in ordered:
        sites = frozenset(map(read_site, keys))
        for site in dict.fromkeys(map(read_site, keys)):
            leading.setdefault(site, sites)
            most.setdefault(site, max(sets[keys], np.finfo(float).tiny))
    pairs = set(map(frozenset, interchangeable))

    def is_one_cause(first: Site, second: Site) -> bool:
        is_close = abs(np.log(most[first] / most[second])) <= nats
        are_together = second in leading[first] or first in leading[second]
        return frozenset((first, second)) in pairs and bool(is_close) and not are_together

    groups: list[list[Site]] = []
    for site in most:
        fitting = (group for group in groups if all(is_one_cause(site, place) for place in group))
        group = next(fitting, None)
        if group is None:
            groups.append([site])
        else:
            group.append(site)
    return [tuple(group) for group in groups]


def sum_presence(
    sets: Mapping[Keys, float], groups: Sequence[Group], settings: DiagnosisSettings
) -> Shares:
    """Return the probability that each cause is present, in the best direction of its first place.

    Args:
        sets: probabilities of sets of causes.
        groups: places of each cause.
        settings: least probability that is listed.
    """
    rows = []
    for group in groups:
        share = sum(
            share for keys, share in sets.items() if not set(group).isdisjoint(map(read_site, keys))
        )
        directions: dict[Key, float] = {}
        for keys, part in sets.items():
            for key in keys:
                if read_site(key) == group[0]:
                    directions[key] = directions.get(key, 0.0) + part
        if share >= settings.min_row_probability:
            rows.append((max(directions, key=lambda key: directions[key]), share))
    return tuple(sorted(rows, key=lambda row: -row[1]))


def weigh_places(
    evidence: Evidence,
    causes: Sequence[tuple[Key, float]],
    unexplained: float,
    constants: Calibration,
) -> tuple[tuple[str, float], ...]:
    """Return places with their shares, which sum to one.

    Args:
        evidence: fits as plain numbers, and free forces.
        causes: causes with their probabilities.
        unexplained: probability of the empty set with a rest.
        constants: calibrated constants.
    """
    shares: dict[str, float] = {}
    for (_, place, _), probability in causes:
        shares[place] = shares.get(place, 0.0) + probability
    for place in evidence.unknown:
        shares[place] = shares.get(place, 0.0) + unexplained / len(evidence.unknown)
    if not evidence.unknown:
        forces = compute_force_shares(evidence.pushed, constants)
        for place, share in forces.items():
            shares[place] = shares.get(place, 0.0) + max(unexplained, NEGLIGIBLE_SHARE) * share
    total = sum(shares.values())
    order = sorted(shares.items(), key=lambda row: -row[1])
    return tuple((place, share / total) for place, share in order)


def compute_force_shares(
    forces: Sequence[ForceGain], constants: Calibration | None = None
) -> dict[str, float]:
    """Return the share of each place at which an unknown force may act."""
    if not forces:
        return {}
    gains = np.array([max(force.gain, 0.0) for force in forces])
    scale = (constants or load_calibration()).force_scale
    shares = softmax(gains / (scale * max(float(gains.max()), 1.0))).tolist()
    return {force.location: share for force, share in zip(forces, shares, strict=True)}
