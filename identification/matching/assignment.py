r"""One-to-one assignment of measured to simulated modes, with probabilities and "no match".

With W[m, a] the odds that measured mode m is the simulated mode a rather than none of them, a
partial matching has the weight prod W over its pairs. Its sum over all partial matchings, and over
those that hold a pair, give the probability of each pair exactly: a sum over sets of simulated
modes that are taken, measured modes one after the other (forward and backward, as of a chain).
"""

from collections.abc import Mapping

import numpy as np
from scipy.optimize import linear_sum_assignment

from identification.words import Real

_LEAST = 1e-9  # of the best odds of a measured mode: a pair that counts
_MOST = 200_000  # sets that are followed; of more, the likeliest
Sets = Mapping[int, float]


def pair_probabilities(odds: Real) -> Real:
    """Probability of every pair.

    Args:
        odds: W; (n_measured, n_simulated).

    Returns:
        (n_measured, n_simulated); one less the sum of a row is that of no match.
    """
    kept = np.where(odds > _LEAST * odds.max(axis=1, keepdims=True, initial=0.0), odds, 0.0)
    # Rows are scaled, none with them, so that products of many stay numbers.
    scale = np.maximum(kept.max(axis=1, initial=0.0), 1.0)
    kept, none = kept / scale[:, None], 1 / scale
    forward = _chain(kept, none)
    backward = _chain(kept[::-1], none[::-1])[::-1]
    found = np.zeros_like(odds)
    total = sum(forward[-1].values())
    for m in range(len(odds)):
        for a in np.flatnonzero(kept[m]).tolist():
            found[m, a] = kept[m, a] * _joined(forward[m], backward[m + 1], 1 << a) / total
    return found


def _chain(odds: Real, none: Real) -> list[dict[int, float]]:
    """Weights of the sets that are taken before each measured mode, and after the last."""
    found: list[dict[int, float]] = [{0: 1.0}]
    for row, alone in zip(odds, none.tolist(), strict=True):
        after: dict[int, float] = {}
        for taken, weight in found[-1].items():
            after[taken] = after.get(taken, 0.0) + weight * alone
            for a in np.flatnonzero(row).tolist():
                if not taken >> a & 1:
                    key = taken | 1 << a
                    after[key] = after.get(key, 0.0) + weight * float(row[a])
        if len(after) > _MOST:
            best = sorted(after, key=lambda key: -after[key])[:_MOST]
            after = {key: after[key] for key in best}
        found.append(after)
    return found


def _joined(before: Sets, behind: Sets, own: int) -> float:
    """Sum over sets before and behind that share nothing, nor the own."""
    total = 0.0
    for taken, weight in before.items():
        if taken & own:
            continue
        used = taken | own
        total += weight * sum(other for key, other in behind.items() if not key & used)
    return total


def best_matching(odds: Real) -> dict[int, int]:
    """The partial matching of the greatest weight: simulated mode of each measured one."""
    gain = np.log(np.maximum(odds, 1e-300))
    # A column of its own for each measured mode stands for none, at odds of one.
    wide = np.hstack([gain, np.where(np.eye(len(odds), dtype=bool), 0.0, -1e6)])
    rows, columns = linear_sum_assignment(-wide)
    pairs = zip(rows.tolist(), columns.tolist(), strict=True)
    return {m: a for m, a in pairs if a < odds.shape[1]}
