r"""What cannot be told apart for want of spare channels.

A fault's signature is the change of the spare channels per error released, everything else fitted
under its tolerance: with N the information of the data on the errors and L the priors' precision,

    K = N - N (N + L / 2)^-1 N

holds all products of signatures. Two faults are twins if the signature of one lies in that of the
other (cosine of the angle between them at least 0.95).
"""

from itertools import combinations

import numpy as np

from identification.solid.ranking import Ranking
from identification.solid.screening import Look
from identification.solid.sensor_faults import HALF, Hypothesis, hypotheses
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
    signatures = [_signature(metric, list(one.channels)) for one in seen]
    cosines = {
        (describe(a), describe(b)): _cosine(*pair)
        for (a, b), pair in zip(combinations(seen, 2), combinations(signatures, 2), strict=True)
    }
    return [pair for pair, cosine in cosines.items() if cosine >= COSINE]


def _released(last: Look) -> list[Hypothesis]:
    return [one for one in hypotheses(last.state) if one.effect in HALF]


def _metric(last: Look, tolerance: Tolerance) -> Real:
    """K; (n_error, n_error)."""
    state = last.state
    information = state.model.slopes(last.moments, last.healthy.errors)[1] / last.scale
    precision = np.diag(0.5 / state.data.sensors.spread(tolerance) ** 2)
    metric: Real = information - information @ np.linalg.solve(information + precision, information)
    return metric


def _signature(metric: Real, errors: list[int]) -> tuple[Real, Real]:
    """Errors with signatures of length one at right angles, and their products with all errors.

    Returns:
        Combinations of all errors; (n_seen, n_error), and those times the metric.
    """
    values, vectors = np.linalg.eigh(metric[np.ix_(errors, errors)])
    seen = values > max(_UNSEEN, 1e-6 * values[-1])
    basis = np.zeros((int(seen.sum()), len(metric)))
    basis[:, errors] = vectors[:, seen].T / np.sqrt(values[seen])[:, None]
    return basis, basis @ metric


def _cosine(first: tuple[Real, Real], second: tuple[Real, Real]) -> float:
    """Of the largest angle between the smaller of two spaces of signatures and the larger."""
    products = first[1] @ second[0].T
    return float(np.linalg.svd(products, compute_uv=False).min()) if products.size else 0.0
