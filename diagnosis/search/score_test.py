r"""Score test (Lagrange multiplier) of each hypothesis, with nuisance parameters projected out.

About a fit, with the normal equations A = N + D of everything that varies (D the priors) and the
gradient g of the cost, the release of the coordinates c of a hypothesis lowers the cost by

    gain = 1/2 g_c' S^-1 g_c,   S = N_cc - N_ct A_tt^-1 N_tc,   g_c -> g_c - N_ct A_tt^-1 g_t.

The nuisance coordinates t are all others that are not at a bound; c has no prior. The weights are
those of the noise and of the model-error floor of the fit. With the noise alone, a fit that lacks a
strong effect is many standard deviations off, and almost any hypothesis seems to explain that
(Rao 1948; Silvey 1959).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.hypothesis import Hypothesis, Scene, find_no_direction, state_nothing
from diagnosis.inference.evidence import Key
from diagnosis.search.linearised_fit import Factor, Gained, ScoredFit
from identification.words import Real
from mbmodel import Model
from tuning import (
    Fit,
    Misfit,
    Parametrisation,
    parametrise,
    thin_lines,
)
from tuning.workers.independent_calls import Call, run_in_parallel


@dataclass(frozen=True, eq=False)
class Score:
    """Predicted gain of a hypothesis.

    Args:
        gain: predicted decrease of the cost at the model-error floor [nats].
        step: step of its coordinates; (n_coordinate,).
        order: its number in the order of proposal, along which shapes are scanned.
        is_of_family: whether the gain is that of a family, of which the hypothesis is a member.
    """

    hypothesis: Hypothesis
    gain: float
    step: Real
    order: int = 0
    is_of_family: bool = False


def scores(
    scene: Scene,
    fit: Fit,
    hypotheses: Sequence[Hypothesis],
    model_error_floor: float,
    stride: int,
) -> list[Score]:
    """Score hypotheses about a fit at its model-error floor, the most promising first.

    Args:
        fit: fit about which the model is linearised.
        model_error_floor: model-error floor of the fit.
        stride: every ``stride``-th line counts.
    """
    return rank_scores(hypotheses, compute_gains(scene, fit, hypotheses, model_error_floor, stride))


def rank_scores(hypotheses: Sequence[Hypothesis], gained: Sequence[Gained]) -> list[Score]:
    """Return the scores of hypotheses, the largest gain first; ties in the order of proposal."""
    scored = [
        _select_member(Score(hypothesis, gain, step, order))
        for order, (hypothesis, (gain, step)) in enumerate(zip(hypotheses, gained, strict=True))
    ]
    best: dict[Key, float] = {}
    for row in scored:
        best[row.hypothesis.key] = max(row.gain, best.get(row.hypothesis.key, 0.0))

    def rank_gain(row: Score) -> float:
        most = best[row.hypothesis.key]
        return most if row.gain >= (1 - row.hypothesis.tie_share) * most else row.gain

    return sorted(scored, key=lambda row: -rank_gain(row))


def _select_member(score: Score) -> Score:
    """Return the score of the member of a family where its step ends; without one, no gain."""
    if score.hypothesis.member is None:
        return score
    member = score.hypothesis.member(score.step)
    if member is None:
        return replace(score, gain=0.0)
    step = np.array([member.begin[name] for name in member.coordinates])
    return replace(score, hypothesis=member, step=step, is_of_family=True)


def compute_gains(
    scene: Scene,
    fit: Fit,
    hypotheses: Sequence[Hypothesis],
    model_error_floor: float,
    stride: int,
) -> list[Gained]:
    """Return gain and step of each hypothesis; see ``scores`` for the arguments.

    A Part that acts in some tests only needs an evaluation for every test, so that its hypotheses
    are scored apart. The others are scored together, since they share the normal equations of the
    fit. Functions that a score does not need are not sent to the processes.
    """
    machine = scene.model.machine
    always = np.array(
        [all(Model(machine, hypothesis.parts).acting_fractions(None)) for hypothesis in hypotheses],
        bool,
    )
    groups = [places for places in map(np.flatnonzero, (always, ~always)) if len(places)]
    reduced = [_reduce_to_parts(hypothesis) for hypothesis in hypotheses]
    without_record = replace(scene, record=None)
    calls: list[Call] = [
        (
            _score_together,
            (without_record, fit, [reduced[k] for k in places], model_error_floor, stride),
        )
        for places in groups
    ]
    gained: dict[int, Gained] = {}
    for places, part in zip(groups, run_in_parallel(calls, scene.jobs), strict=True):
        gained |= zip(places.tolist(), part, strict=True)
    return [gained[k] for k in range(len(hypotheses))]


def _reduce_to_parts(hypothesis: Hypothesis) -> Hypothesis:
    """Return a hypothesis without the functions of refits and verdicts, to send it to a process."""
    return replace(
        hypothesis,
        correct=None,
        reform=None,
        movable=None,
        member=None,
        state=state_nothing,
        along=find_no_direction,
    )


def _score_together(
    scene: Scene,
    fit: Fit,
    hypotheses: Sequence[Hypothesis],
    model_error_floor: float,
    stride: int,
) -> list[Gained]:
    """Return gains and steps in the order of the hypotheses."""
    model, whole, x = extend_model(scene, fit, hypotheses)
    count = fit.parametrisation.size
    wanted = {name for hypothesis in hypotheses for name in hypothesis.coordinates}
    is_scored = np.array([name in wanted for name in whole.names[count:]], bool)
    varies = whole.restrict(np.arange(whole.size) < count, x)
    probes = whole.restrict(np.append(np.zeros(count, bool), is_scored), x)
    thin = thin_lines(scene.session.campaign, stride * scene.stride_factor)
    probed = Misfit(model, thin, varies, model_error_floor=model_error_floor).probe_coordinates(
        fit.x, probes
    )
    fitted = ScoredFit(fit.parametrisation, fit.x, probed)
    place = {name: k for k, name in enumerate((*varies.names, *probes.names))}
    return [
        fitted.score(
            hypothesis, np.array([place[name] for name in hypothesis.coordinates], np.intp)
        )
        for hypothesis in hypotheses
    ]


def compute_cosines(
    scene: Scene, fit: Fit, leading: Sequence[Score], model_error_floor: float, stride: int
) -> Real:
    """Return the cosines between the signatures of hypotheses, all else projected out.

    With d_a the weighted change of the FRFs by the step of hypothesis a, and P the projection that
    removes all that can be tuned, the cosine is d_a' P d_b / (|P d_a| |P d_b|). Confounded causes
    have nearly 1.

    Args:
        fit: fit about which the scores were computed.
        leading: scores of the hypotheses.
        model_error_floor, stride: as for ``scores``.

    Returns:
        (n_leading, n_leading).
    """
    model, whole, x = extend_model(scene, fit, [score.hypothesis for score in leading])
    count = fit.parametrisation.size
    thin = thin_lines(scene.session.campaign, stride * scene.stride_factor)
    normal = (
        Misfit(model, thin, whole, model_error_floor=model_error_floor)
        .quadratic_model(x)[2]
        .dense()
    )
    place = {name: k for k, name in enumerate(whole.names)}
    steps = np.zeros((whole.size, len(leading)))
    for column, score in enumerate(leading):
        for name, step in zip(score.hypothesis.coordinates, score.step, strict=True):
            steps[place[name], column] = step
    released = np.isin(np.arange(whole.size), np.flatnonzero(steps.any(axis=1)))
    tuned = np.flatnonzero(
        ~released & ~whole.coordinates_at_bound(x) & (np.arange(whole.size) < count)
    )
    precision = np.diag(whole.precision[tuned])
    factor = Factor.factorise(normal[np.ix_(tuned, tuned)] + precision)
    cross = normal[tuned] @ steps
    inner = steps.T @ normal @ steps - cross.T @ factor.solve(cross)
    size = np.sqrt(np.maximum(np.diag(inner), np.finfo(float).tiny))
    cosine: Real = inner / np.outer(size, size)
    return cosine


def extend_model(
    scene: Scene, fit: Fit, hypotheses: Sequence[Hypothesis]
) -> tuple[Model, Parametrisation, Real]:
    """Return model and coordinates with the Parts of hypotheses, and the fit in coordinates."""
    session = scene.session
    parts = dict.fromkeys(part for hypothesis in hypotheses for part in hypothesis.parts)
    model = Model(session.model.machine, (*session.model.parts, *parts))
    whole = fit.parametrisation.extend(parametrise(model, session.campaign.tolerance))
    return model, whole, np.append(fit.x, np.zeros(whole.size - fit.parametrisation.size))


def select_best_of_sites(ranked: Sequence[Score]) -> list[Score]:
    """Return the best score of each effect and place, the most promising first."""
    best: dict[tuple[str, str], Score] = {}
    for score in ranked:
        if score.gain > 0 or score.hypothesis.otherwise:
            best.setdefault(score.hypothesis.key[:2], score)
    return list(best.values())


def list_peaks(scanned: Sequence[Score]) -> list[Score]:
    """Return the scores of one effect and place that no neighbour in its scan exceeds, best first.

    The gain has several maxima along a scanned frequency: between two modes that have them both,
    an appendage explains nothing. A fit that begins at one of them does not reach the next.

    Args:
        scanned: scores of the shapes of one effect and place.
    """
    rows = sorted(scanned, key=lambda score: score.order)
    gains = np.array([0.0, *(score.gain for score in rows), 0.0])
    is_peak = (gains[1:-1] > gains[:-2]) & (gains[1:-1] >= gains[2:])
    peaks = [score for score, is_top in zip(rows, is_peak, strict=True) if is_top]
    return sorted(peaks, key=lambda score: -score.gain)
