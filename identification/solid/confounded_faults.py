"""Faults that the redundant channels of a body cannot tell apart.

The signature of a fault is the change of the redundant channels per released error, with everything
else fitted under its tolerance. With N the information of the data on the errors and L the
precision of the priors, the Schur complement

    K = N - N (N + L / 2)^-1 N

holds all products of signatures. Two faults are confounded if the signature of one lies in that of
the other (cosine of the angle between them at least 0.95).
"""

from itertools import combinations

import numpy as np

from identification.solid.ranking import Ranking
from identification.solid.screening import BodyFit
from identification.solid.sensor_faults import CAUCHY_SCALE, FaultHypothesis, list_hypotheses
from identification.words import Real, Tolerance

MIN_CONFOUNDED_COSINE = 0.95  # cosine between two signatures above which faults are confounded
MIN_EVIDENCE_NATS = 3.0  # difference of log evidence that counts; odds of 20 to 1
_MIN_SIGNATURE = 1e-12  # squared signature below which an error leaves no trace


def fault_label(hypothesis: FaultHypothesis) -> str:
    """Return effect, place and direction in one label: ``sensor_gain@sensor:acc1:tx``."""
    name = f"{hypothesis.effect}@{hypothesis.location}"
    return name if hypothesis.dof is None else f"{name}:{hypothesis.dof}"


def find_confounded(
    ranking: Ranking, last: BodyFit, tolerance: Tolerance
) -> tuple[tuple[str, str], ...]:
    """Return pairs of hypotheses that the channels cannot tell apart.

    Args:
        ranking: ranking at the nominal body.
        last: fit of the body with all accepted faults.
    """
    pairs = [*find_near_ties(ranking), *_find_equal_signatures(last, tolerance)]
    return tuple(dict.fromkeys(pairs))


def find_near_ties(ranking: Ranking) -> list[tuple[str, str]]:
    """Return pairs of the most probable fault and each fault within 3 nats of it."""
    faults = [
        (nats, candidate.hypothesis)
        for nats, candidate in zip(ranking.nats, ranking.candidates, strict=True)
        if candidate.hypothesis is not None
    ]
    if not faults or ranking.null_index == 0:
        return []
    best = faults[0]
    return [
        (fault_label(best[1]), fault_label(rival))
        for nats, rival in faults[1:]
        if nats - best[0] < MIN_EVIDENCE_NATS
    ]


def find_unidentifiable(last: BodyFit, tolerance: Tolerance) -> tuple[str, ...]:
    """Return labels of errors that could be large and leave no trace: p^T K p below 3 nats.

    Large is half of the prior width of a released error: a gain 20 % off, a sensor turned by 0.2
    rad or 30 mm away, in the direction that shows most.
    """
    metric = _signature_metric(last, tolerance)
    return tuple(
        fault_label(hypothesis)
        for hypothesis in _released_hypotheses(last)
        if np.linalg.eigvalsh(metric[np.ix_(hypothesis.channels, hypothesis.channels)])[-1]
        * CAUCHY_SCALE[hypothesis.effect] ** 2
        < MIN_EVIDENCE_NATS
    )


def _find_equal_signatures(last: BodyFit, tolerance: Tolerance) -> list[tuple[str, str]]:
    """Return pairs of identifiable errors whose signatures are parallel."""
    metric, hidden = _signature_metric(last, tolerance), find_unidentifiable(last, tolerance)
    visible = [
        hypothesis
        for hypothesis in _released_hypotheses(last)
        if fault_label(hypothesis) not in hidden
    ]
    signatures = [_signature_basis(metric, list(hypothesis.channels)) for hypothesis in visible]
    cosines = {
        (fault_label(a), fault_label(b)): _subspace_cosine(*pair)
        for (a, b), pair in zip(combinations(visible, 2), combinations(signatures, 2), strict=True)
    }
    return [pair for pair, cosine in cosines.items() if cosine >= MIN_CONFOUNDED_COSINE]


def _released_hypotheses(last: BodyFit) -> list[FaultHypothesis]:
    """Return the hypotheses that release an error of a sensor."""
    return [
        hypothesis
        for hypothesis in list_hypotheses(last.state)
        if hypothesis.effect in CAUCHY_SCALE
    ]


def _signature_metric(last: BodyFit, tolerance: Tolerance) -> Real:
    """Compute K; (n_error, n_error)."""
    state = last.state
    information = state.model.slopes(last.moments, last.healthy.errors)[1] / last.noise_scale
    precision = np.diag(0.5 / state.data.sensors.spread(tolerance) ** 2)
    return information - information @ np.linalg.solve(information + precision, information)


def _signature_basis(metric: Real, errors: list[int]) -> tuple[Real, Real]:
    """Return an orthonormal basis of the signatures of some errors, and its products.

    Returns:
        Combinations of all errors; (n_visible, n_error), and those times the metric.
    """
    values, vectors = np.linalg.eigh(metric[np.ix_(errors, errors)])
    visible = values > max(_MIN_SIGNATURE, 1e-6 * values[-1])
    basis = np.zeros((int(visible.sum()), len(metric)))
    basis[:, errors] = vectors[:, visible].T / np.sqrt(values[visible])[:, None]
    return basis, basis @ metric


def _subspace_cosine(first: tuple[Real, Real], second: tuple[Real, Real]) -> float:
    """Return the cosine of the largest angle between the smaller and the larger subspace."""
    products = first[1] @ second[0].T
    return float(np.linalg.svd(products, compute_uv=False).min()) if products.size else 0.0
