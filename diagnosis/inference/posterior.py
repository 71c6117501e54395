r"""Posterior: decides whether nothing, one cause, several or something unexplained is missing.

What is left of the gap decides. With e the gap's mean square over the noise of the refit without
any effect (``evidence.Gapped``) and e1 that of the best refit with one, both without bounds of
tolerances if the largest is no more than an outlier,

    visible   = expit((log e - log hidden) / width)       more than chance or badly known noise, or
                hits that differed and left a gap, which none of these effects makes
    told      = expit((log gain - log told) / width)      the best refit gains more nats than the
                best of all gains by chance: badly known noise gains nothing by a mass at one body
    explained = told expit((log (left min(e^0.75, e^0.25) + exact) - log e1) / width)
                and leaves what is no gap for sure and next to nothing of the one there was: of a
                large one the true one leaves a smaller part

and p(none) = (1 - explained)(1 - visible), what is told being visible. What the best effect leaves
is a gap of its own, of which two at once explain the part twofold, likewise: that part of what one
explains, and of what none does, goes to several causes. Among causes, and among pairs, costs differ
by thousands of nats where the noise alone counts, but a model is never so exact. Of n values, with
cost0 without any effect, or of pairs with the best single one,

    p(cause) = explained softmax(-cost / (least + inexact n + temper (cost0 - best)))

Of rivals it is also known what they foretell of data that their fits did not see (``foretold``).
That differs by hundreds of nats by chance, and costs by a few where the best leaves nothing: among
rivals both count, each in nats of its own, where e1 n nats are left by what no model holds,

    p(rival) ~ exp(-cost / (rival + 0.1 e1 n) - foretold / told0).

A sensor that gates proved wrong by no fault of the catalogue is something that is missing and that
nothing explains: then p(none) is that of the sensor, unexplained.

Tolerances that are released and lie no farther off than an outlier are an outlier: with such a one
nothing is missing, and of two effects one of which is such there is the other alone.

Places: of what a cause explains, the cause's; of what nothing explains, a softmax of what a free
force gains at each place, with odds for joints. Most constants are calibrated on virtual campaigns
whose seeds no reported figure uses; ``calibration.json`` says which.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.special import expit, softmax

from diagnosis.inference.calibration import Calibration, calibrated
from diagnosis.inference.evidence import BENDS, Evidence, Key, Paired, Refitted
from identification.words import Real

_POWER = 0.75  # of the gap: with what is left of it compared
# Of a large one: right effects leave a tenth of a gap of thirty, and no more of five hundred; what
# leaves one of seventeen explains most, as an added mass does of an inerter, and is not all.
_LARGE = 0.25
_LEAST = 0.002  # of the variance, that a refit leaves at least
_UNTRUE = 0.1  # of the nats that the best leaves unexplained: what may favour a wrong rival
_ROW = 0.01  # probability of a cause that is worth a row
_LIKELY = 0.5
NATS = 3.0  # less between two causes does not tell them apart
# Odds of a joint over a body, both of which a low mode moves alike: what nobody has thought of is
# in springs, guides, contacts and drives.
_AT_JOINT = 2.0
_STEADY = 0.05  # of the probability of none that is left where hits differed and left a gap
Keys = tuple[Key, ...]
Site = tuple[str, str]  # effect, location
Shares = tuple[tuple[Key, float], ...]


@dataclass(frozen=True)
class Posterior:
    """Probabilities.

    Args:
        none, unexplained, several: of what is no single cause.
        causes: with the probability that each is present, most probable first.
        where: places by their share.
        present: the causes that the verdict says are there, the most probable first; what a gate
            proved is there whatever the verdict, even beside what nobody explains.
        sets: of causes that are there at once, each with its probability; beside what gates proved.
    """

    none: float
    unexplained: float
    several: float
    causes: Shares
    where: tuple[tuple[str, float], ...]
    present: tuple[Key, ...]
    sets: tuple[tuple[Keys, float], ...] = ()

    @property
    def word(self) -> str:
        """The verdict's word."""
        return _word(self.none, self.unexplained, self.several)

    @property
    def twins(self) -> tuple[tuple[Site, Site], ...]:
        """Causes one of which in place of the other is not 20 times as probable, the rest alike.

        Three nats of what decides anything: at 95 % neither is excluded.
        """
        shares: dict[frozenset[Site], float] = {}
        for keys, share in self.sets:
            sites = frozenset(map(_site, keys))
            shares[sites] = shares.get(sites, 0.0) + share
        likely = [one for one in shares.items() if one[1] >= _ROW]
        found: list[tuple[Site, Site]] = []
        for (one, share), (other, less) in combinations(sorted(likely, key=lambda x: -x[1]), 2):
            if len(one - other) == len(other - one) == 1 and share < less * np.exp(NATS):
                (first,), (second,) = one - other, other - one
                found.append((first, second))
        return tuple(dict.fromkeys(found))


def _word(none: float, unexplained: float, several: float) -> str:
    """The most probable of none, unexplained, several and a single cause."""
    options = {
        "none": none,
        "unexplained": unexplained,
        "several": several,
        "explained": 1 - none - unexplained - several,
    }
    return max(options, key=lambda name: options[name])


def judge(seen: Evidence, by: Calibration | None = None) -> Posterior:
    """Weigh what is left.

    Args:
        seen: the evidence.
        by: the calibration; the committed one if None.
    """
    by = by or calibrated()
    seen = _without_outliers(seen, by.outlier)
    doubt, sure = 1 - by.sure, by.sure
    visible, explained, twofold = _parts(seen, by)
    if seen.unsteady and not seen.is_noise:
        visible = 1 - _STEADY * (1 - visible)
    seeming = (1 - explained) * visible
    none = sure * (1 - explained) * (1 - visible) + doubt / 2
    unknown = sure * seeming * (1 - twofold) + doubt / 2
    strange = none - doubt / 2 if seen.unknown else 0.0  # a sensor is wrong, nobody knows how
    none -= strange
    alone, double = sure * explained * (1 - twofold), sure * (explained + seeming) * twofold
    ones = [(one.key,) for one in seen.refits]
    sets = _shared(alone, ones, _weights(seen, by, seen.refits, (seen.cost, seen.gap)))
    single = min((one.cost for one in seen.refits), default=seen.cost)
    twos = [one.keys for one in seen.pairs]
    gap = _left(seen.refits, by) if seen.refits else seen.gap
    sets |= _shared(double, twos, _weights(seen, by, seen.pairs, (single, gap)))
    if not seen.proven:
        several = sum(share for keys, share in sets.items() if _count(keys) > 1)
        causes = _rows(sets)
        where = _places(seen, by, causes, unknown, strange)
        return _judged(none, unknown + strange, several, causes, sets, where)
    if any(effect == BENDS for effect, _, _ in seen.proven):
        unknown = doubt / 2  # it drives all bodies in ways that no Part holds: a gap is no surprise
    # What a gate proved is present: alone, with other causes, or with what nobody knows.
    certain, others = sure * (1 - unknown / 2), sure * (alone + double)
    beside = {keys: sure * share for keys, share in sets.items()}
    several = certain if _count(seen.proven) > 1 else others
    rest = 1 - certain
    causes = _rows({seen.proven: certain} | beside)
    where = _places(seen, by, causes, rest, rest if seen.unknown else 0.0)
    word = _word(doubt / 2, rest - doubt / 2, several)
    present = seen.proven
    if word == "several" and others > _LIKELY:
        many = sum(share for keys, share in beside.items() if _count(keys) > 1)
        present += _likeliest(beside, _rows(beside), several=2 * many > others)
    return Posterior(
        doubt / 2, rest - doubt / 2, several, causes, where, present, tuple(beside.items())
    )


def _judged(
    none: float,
    unexplained: float,
    several: float,
    causes: Shares,
    sets: Mapping[Keys, float],
    where: tuple[tuple[str, float], ...],
) -> Posterior:
    """With what is there: the likeliest set of several causes if they are, else of one."""
    word = _word(none, unexplained, several)
    present: Keys = ()
    if word in ("explained", "several"):
        present = _likeliest(sets, causes, several=word == "several")
    return Posterior(none, unexplained, several, causes, where, present, tuple(sets.items()))


def _likeliest(sets: Mapping[Keys, float], causes: Shares, *, several: bool) -> Keys:
    """Of one cause or of several, the likeliest set with the likeliest cause, that one first."""
    first = _site(causes[0][0])
    possible = [keys for keys in sets if (_count(keys) > 1) == several]
    chosen = max(possible, key=lambda keys: (first in map(_site, keys), sets[keys]))
    order = {_site(key): number for number, (key, _) in enumerate(causes)}
    return tuple(sorted(chosen, key=lambda key: order.get(_site(key), len(order))))


def _without_outliers(seen: Evidence, outlier: float) -> Evidence:
    """The same, tolerances let lie where they are released and no farther off than an outlier."""

    def is_odd(off: float | None) -> bool:
        return off is not None and off <= outlier

    nothing = [1 + one.gap for one in seen.refits if is_odd(one.off)]
    ones = {one.key: one for one in seen.refits if not is_odd(one.off)}
    pairs = []
    for both in seen.pairs:
        there = [key for key, off in zip(both.keys, both.off, strict=True) if not is_odd(off)]
        if len(there) == 2:
            pairs.append(both)
        elif not there:
            nothing.append(1 + both.gap)
        elif there[0] in ones and both.cost < ones[there[0]].cost:
            ones[there[0]] = ones[there[0]].model_copy(
                update={
                    "cost": both.cost,
                    "chi_square": both.chi_square,
                    "serial": both.serial,
                }
            )
    refits = tuple(sorted(ones.values(), key=lambda one: one.cost))
    update: dict[str, object] = {"refits": refits, "pairs": tuple(pairs)}
    if nothing:
        before = seen.loose if seen.pull <= outlier else 1 + seen.gap
        update |= {"loose": min(*nothing, before), "pull": outlier}
    return seen.model_copy(update=update)


def _parts(seen: Evidence, by: Calibration) -> tuple[float, float, float]:
    """Whether there is a gap, one effect explains it, two do."""
    if seen.is_noise:
        return 0.0, 0.0, 0.0
    without = seen.left(by.outlier)
    beyond, hidden = max(without, 1e-6), by.hidden[seen.by] * seen.scatter
    visible = float(expit((np.log(beyond) - np.log(hidden)) / by.hidden_width))
    left = _left(seen.refits, by)
    told = _told(without - left, seen, by)
    explained = told * _explains(left, seen.gap, seen, by)
    second = _left(seen.pairs, by)
    twofold = _told(left - second, seen, by) * _explains(second, left, seen, by)
    return max(visible, told), explained, twofold


def _told(gained: float, seen: Evidence, by: Calibration) -> float:
    """Whether so much of the gap is more than the best of all hypotheses gains by chance."""
    if not np.isfinite(gained):
        return 0.0
    nats = max(gained, 0.0) * seen.cost / seen.chi_square
    return float(expit((np.log(max(nats, 1.0)) - np.log(by.told[seen.by])) / by.told_width))


def _left(fits: Sequence[Refitted] | Sequence[Paired], by: Calibration) -> float:
    """Of the gap, by the best."""
    return min((one.left(by.outlier) for one in fits), default=np.inf)


def compared(gap: float) -> float:
    """What is left of a gap is compared with."""
    gap = max(gap, _LEAST)
    return float(min(gap**_POWER, gap**_LARGE))


def _explains(left: float, gap: float, seen: Evidence, by: Calibration) -> float:
    """Whether what is left of a gap is no more than right effects leave."""
    if not np.isfinite(left):
        return 0.0
    likely = by.left[seen.by] * compared(gap) + by.exact[seen.by] * seen.scatter
    return float(expit((np.log(likely) - np.log(max(left, _LEAST))) / by.left_width))


def _weights(
    seen: Evidence,
    by: Calibration,
    fits: Sequence[Refitted] | Sequence[Paired],
    before: tuple[float, float],
) -> Real:
    """Of refits, beside each other; before are cost and gap of what they improve upon.

    Who leaves a part of the gap that the best one takes explains it so much less.
    """
    if not fits:
        return np.zeros(0)
    costs = np.array([one.cost for one in fits])
    values = seen.cost / seen.chi_square
    cost, gap = before
    gain = max(cost - costs.min(), 0.0)
    best, most = min(one.gap for one in fits), _left(fits, by)
    takes = [_explains(most + one.gap - best, gap, seen, by) for one in fits]
    told = np.array([one.foretold for one in fits], float)
    rivals = np.isfinite(told)
    scale = by.least + by.inexact * values
    if rivals.sum() < 2:
        rivals[:] = False
        scale += by.temper * gain
    lost = costs / scale
    if rivals.any():
        near = by.rival + _UNTRUE * max(best, 0.0) * values
        own = costs[rivals] / near + told[rivals] / by.foretold
        lost[rivals] = lost[rivals].min() + own - own.min()
    weights: Real = softmax(-lost + np.log(np.maximum(takes, np.finfo(float).tiny)))
    return weights


def _shared(whole: float, sets: Sequence[Keys], weights: Real) -> dict[Keys, float]:
    """A probability divided among sets of causes."""
    shares: dict[Keys, float] = {}
    for keys, weight in zip(sets, weights, strict=True):
        shares[keys] = shares.get(keys, 0.0) + whole * float(weight)
    return shares


def _site(key: Key) -> Site:
    """Effect and place: in several directions it is one cause."""
    return key[0], key[1]


def _count(keys: Keys) -> int:
    """How many causes a set holds."""
    return len({_site(key) for key in keys})


def _rows(sets: Mapping[Keys, float]) -> Shares:
    """That each effect is present at its place, of all sets that hold it, in its best direction.

    Most probable first, none below one per cent.
    """
    present: dict[Site, float] = {}
    best: dict[Site, dict[Key, float]] = {}
    for keys, share in sets.items():
        for site in dict.fromkeys(map(_site, keys)):
            present[site] = present.get(site, 0.0) + share
        for key in keys:
            own = best.setdefault(_site(key), {})
            own[key] = own.get(key, 0.0) + share
    rows = [(max(best[site], key=lambda key: best[site][key]), p) for site, p in present.items()]
    return tuple(sorted((row for row in rows if row[1] >= _ROW), key=lambda row: -row[1]))


def _places(
    seen: Evidence, by: Calibration, causes: Shares, unknown: float, strange: float
) -> tuple[tuple[str, float], ...]:
    """Places by their share, which sum to one."""
    shares: dict[str, float] = {}
    for (_, place, _), probability in causes:
        shares[place] = shares.get(place, 0.0) + probability
    for place in seen.unknown:
        shares[place] = shares.get(place, 0.0) + strange / len(seen.unknown)
    if seen.pushed:
        gains = np.array([max(one.gain, 0.0) for one in seen.pushed])
        odds = [_AT_JOINT if one.location.startswith("joint:") else 1.0 for one in seen.pushed]
        own = softmax(gains / (by.share * gains.max() + by.least) + np.log(odds))
        for one, share in zip(seen.pushed, own.tolist(), strict=True):
            shares[one.location] = shares.get(one.location, 0.0) + max(unknown, 1e-3) * share
    total = sum(shares.values())
    order = sorted(shares.items(), key=lambda one: -one[1])
    return tuple((place, share / total) for place, share in order)
