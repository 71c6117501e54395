r"""One-to-one assignment of measured to simulated modes, with probabilities and "no match".

With W[m, a] the odds that measured mode m is the simulated mode a rather than none of them, a
partial matching has the weight prod W over its pairs. Its sum over all partial matchings, and over
those that hold a pair, give the probability of each pair exactly: a sum over sets of simulated
modes that are taken, measured modes one after the other (forward and backward, as of a chain). A
simulated mode that no later measured one may be is forgotten, for it no longer tells sets apart.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from identification.words import Integers, Real

_LEAST = 1e-9  # of the best odds of a measured mode: a pair that counts
_MOST = 30_000  # sets that are followed; of more (from 15 modes on), the likeliest
_NONE = -1  # the simulated mode of what matches none


@dataclass(frozen=True, eq=False)
class _Step:
    """One measured mode: sets before it, sets behind it, ways between them.

    Args:
        weights: of the sets before it; (n_before,).
        ways: a simulated mode or none, its odds, the sets before and behind; n_way.
        behind: how many sets there are behind it.
    """

    weights: Real
    ways: tuple[tuple[int, float, Integers, Integers], ...]
    behind: int


def pair_probabilities(odds: Real) -> Real:
    """Probability of every pair.

    Args:
        odds: W; (n_measured, n_simulated).

    Returns:
        (n_measured, n_simulated); one less the sum of a row is that of no match.
    """
    best = odds.max(axis=1, keepdims=True, initial=1.0)
    # Rows are scaled, none with them, so that products of many stay numbers.
    kept, none = np.where(odds > _LEAST * best, odds, 0.0) / best, 1 / best[:, 0]
    used = np.flatnonzero(kept.any(axis=0))  # bits of the sets
    steps = _chain(kept[:, used], none)
    found = np.zeros_like(odds)
    behind = np.ones(steps[-1].behind if steps else 0)
    for row, step in zip(found[::-1], reversed(steps), strict=True):
        before = np.zeros(len(step.weights))
        shares = np.zeros(len(used) + 1)  # the last of none
        for mode, weight, begin, end in step.ways:
            onward = weight * behind[end]
            np.add.at(before, begin, onward)
            shares[mode] = step.weights[begin] @ onward
        row[used] = shares[:-1] / shares.sum()
        behind = before / before.max()
    return found


def _chain(odds: Real, none: Real) -> list[_Step]:
    """All measured modes one after the other."""
    still = np.logical_or.accumulate(odds[::-1] > 0, axis=0)[::-1]
    later = np.vstack([still[1:], np.zeros((1, odds.shape[1]), bool)])
    taken, weights, steps = [0], np.ones(1), []
    for row, alone, ahead in zip(odds, none.tolist(), later, strict=True):
        mask = sum(1 << one for one in np.flatnonzero(ahead).tolist())
        number: dict[int, int] = {}
        ways = []
        for mode in (_NONE, *np.flatnonzero(row).tolist()):
            bit = 0 if mode == _NONE else 1 << mode
            begin = [k for k, one in enumerate(taken) if not one & bit]
            end = [number.setdefault((taken[k] | bit) & mask, len(number)) for k in begin]
            weight = alone if mode == _NONE else float(row[mode])
            ways.append((mode, weight, np.array(begin, np.intp), np.array(end, np.intp)))
        total = np.zeros(len(number))
        for _, weight, old, new in ways:
            np.add.at(total, new, weight * weights[old])
        likely = np.sort(np.argsort(-total, kind="stable")[:_MOST])
        place = np.full(len(total), -1)
        place[likely] = np.arange(len(likely))
        left = [(m, w, b[place[e] >= 0], place[e][place[e] >= 0]) for m, w, b, e in ways]
        steps.append(_Step(weights, tuple(left), len(likely)))
        keys = list(number)
        taken, weights = [keys[k] for k in likely.tolist()], total[likely] / total[likely].sum()
    return steps


def best_matching(odds: Real) -> dict[int, int]:
    """The partial matching of the greatest weight: simulated mode of each measured one."""
    gain = np.log(np.maximum(odds, 1e-300))
    # A column of its own for each measured mode stands for none, at odds of one.
    wide = np.hstack([gain, np.where(np.eye(len(odds), dtype=bool), 0.0, -1e6)])
    rows, columns = linear_sum_assignment(-wide)
    pairs = zip(rows.tolist(), columns.tolist(), strict=True)
    return {m: a for m, a in pairs if a < odds.shape[1]}
