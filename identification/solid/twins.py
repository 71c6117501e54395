r"""What cannot be told apart for want of spare channels.

A fault's signature is the change of the spare channels per error released, everything else fitted
under its tolerance: with N the information of the data on the errors and L the priors' precision,

    K = N - N (N + L / 2)^-1 N

holds all products of signatures. Two faults are twins if the signature of one lies in that of the
other (cosine of the angle between them at least 0.95).
"""

from itertools import combinations

import numpy as np

from identification.solid.hypotheses import HALF, Hypothesis, hypotheses
from identification.solid.judge import Ranking
from identification.solid.looks import Look
from identification.words import Real, Tolerance

COSINE = 0.95
NATS = 3.0
_UNSEEN = 1e-12


def describe(one: Hypothesis) -> str:
    """Effect, place and direction in one label: ``sensor_gain@sensor:acc1:tx``."""
    name = f"{one.effect}@{one.location}"
    return name if one.dof is None else f"{name}:{one.dof}"


def twins(ranking: Ranking, last: Look, tolerance: Tolerance) -> tuple[tuple[str, str], ...]:
    """Pairs of hypotheses that look alike.

    Args:
        ranking: of the body as drawn.
        last: look at the body as believed in the end.
        tolerance: of the drawings.
    """
    pairs = [*close_pairs(ranking), *_alike(last, tolerance)]
    return tuple(dict.fromkeys(pairs))


def close_pairs(ranking: Ranking) -> list[tuple[str, str]]:
    """The most probable fault and those within 3 nats of it."""
    faults = [
        (nats, one.hypothesis)
        for nats, one in zip(ranking.nats, ranking.judged, strict=True)
        if one.hypothesis is not None
    ]
    if not faults or ranking.none == 0:
        return []
    best = faults[0]
    return [
        (describe(best[1]), describe(other)) for nats, other in faults[1:] if nats - best[0] < NATS
    ]


def unseen(last: Look, tolerance: Tolerance) -> tuple[str, ...]:
    """Errors of sensors that could be large and leave no mark: p^T K p below 3 nats.

    Large is half of what a released error's prior holds: a gain 20 % off, a sensor turned by 0.2
    rad or 30 mm away, in whatever direction shows most.
    """
    metric = _metric(last, tolerance)
    return tuple(
        describe(one)
        for one in _released(last)
        if np.linalg.eigvalsh(metric[np.ix_(one.channels, one.channels)])[-1]
        * HALF[one.effect] ** 2
        < NATS
    )


def _alike(last: Look, tolerance: Tolerance) -> list[tuple[str, str]]:
    """Pairs of released errors with one signature, both of which can be seen."""
    metric, hidden = _metric(last, tolerance), unseen(last, tolerance)
    seen = [one for one in _released(last) if describe(one) not in hidden]
    return [
        (describe(a), describe(b))
        for a, b in combinations(seen, 2)
        if _cosine(metric, list(a.channels), list(b.channels)) >= COSINE
    ]


def _released(last: Look) -> list[Hypothesis]:
    return [one for one in hypotheses(last.state) if one.effect in HALF]


def _metric(last: Look, tolerance: Tolerance) -> Real:
    """K; (n_error, n_error)."""
    state = last.state
    information = state.model.slopes(last.moments, last.healthy.errors)[1] / last.scale
    precision = np.diag(0.5 / state.data.sensors.spread(tolerance) ** 2)
    metric: Real = information - information @ np.linalg.solve(information + precision, information)
    return metric


def _cosine(metric: Real, first: list[int], second: list[int]) -> float:
    """Of the largest angle between the smaller of two spaces of errors and the larger."""
    bases = [_root(metric[np.ix_(k, k)]) for k in (first, second)]
    if not all(len(base) for base in bases):
        return 0.0
    cosines = np.linalg.svd(bases[0] @ metric[np.ix_(first, second)] @ bases[1].T, compute_uv=False)
    return float(cosines.min())


def _root(block: Real) -> Real:
    """Combinations of errors with signatures of length one at right angles; (n_seen, n)."""
    values, vectors = np.linalg.eigh(block)
    seen = values > max(_UNSEEN, 1e-6 * values[-1])
    root: Real = vectors[:, seen].T / np.sqrt(values[seen])[:, None]
    return root
