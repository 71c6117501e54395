r"""What to measure next: what separates the leading causes best, or confirms the one there is.

Of rivals with probabilities p, fitted to what was measured, an experiment is foreseen to tell

    gain = sum over i, j of p_i p_j / sum(p)^2  D_ij   [nats],

the expected log of the odds that it moves (Lindley 1956). D_ij is what j still leaves of the
experiment if i is true, tuned anew to it and to all that was measured before:

    D_ij = min over dx of  |(H_i - H_j - J_j dx) / sigma|^2 + dx' (N_j + P) dx / 2
         = c - g' (N_j + P + N_new)^-1 g / 2,

N_j the normal equations of what was measured, P those of the priors, c, g and N_new cost, gradient
and normal equations of j against the FRFs that i foresees, with the noise of the tests there are. A
new hit is off by tolerances of its own, which are tuned with all others.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from diagnosis.algorithm import Diagnosis
from diagnosis.effects import PROVEN, load_catalogue
from diagnosis.inference.evidence import Key
from diagnosis.inference.posterior import Keys
from diagnosis.next_test.experiments import (
    Experiment,
    RivalModel,
    add_experiment,
    list_experiments,
)
from diagnosis.next_test.unexplained import propose_unexplained_test
from diagnosis.refits.refit import Refit
from identification.words import Campaign, Real
from tuning import Misfit, mean_channel_variance, predict_tests, thin_lines
from tuning.assessment.parameter_confidence import FREE_PRIOR_SD

_EXPERIMENT_STRIDE = 8
_DECISIVE_NATS = 30.0  # nats: who gains more decides, then the least effort does
_MIN_TELLING_NATS = 3.0  # nats: what gains less tells nothing
_MIN_RIVAL_PROBABILITY, _MAX_RIVALS = 0.05, 6  # of sets that an experiment is to tell apart


def propose_experiment(diagnosis: Diagnosis) -> str | None:
    """One sentence; None where nothing is missing.

    Args:
        diagnosis: the diagnosis.
    """
    word, causes = diagnosis.present.word, diagnosis.posterior.causes
    if word == "none":
        return None
    if word == "unexplained" or not causes:
        proven = [f"{_confirm_cause(cause.key)}; then " for cause in diagnosis.present.causes]
        return "".join(proven) + propose_unexplained_test(diagnosis)
    rivals = find_rivals(diagnosis)
    if len(rivals) > 1:
        refits = [(refit, share) for _, refit, share in rivals]
        best, gain = find_best_experiment(diagnosis.session.campaign, refits)
        (first, _, _), (second, _, _), *_ = rivals
        if gain > _MIN_TELLING_NATS:
            pair = f"{_without(first, second)} from {_without(second, first)}"
            return f"{best.words}: foreseen to tell {pair} by {gain:.2g} nats"
    return _confirm_cause(causes[0][0])


def find_rivals(diagnosis: Diagnosis) -> list[tuple[Keys, Refit, float]]:
    """Return sets of as many causes as the verdict names, any of which may be present.

    Args:
        diagnosis: the diagnosis.

    Returns:
        Causes, refit and probability of each set, the most probable first.
    """
    count = len(diagnosis.present.causes) - len(diagnosis.gross_hypotheses)
    proven = {cause.key for cause in diagnosis.gross_hypotheses}
    rivals = []
    for keys, share in diagnosis.posterior.sets:
        added = tuple(key for key in keys if key not in proven)
        refit = diagnosis.search.refit_of(added)
        if share >= _MIN_RIVAL_PROBABILITY and len(added) == max(count, 1) and refit is not None:
            rivals.append((added, refit, share))
    return rivals[:_MAX_RIVALS]


def _without(several: Keys, excluded: Keys) -> str:
    """Those that are not among others, such as ``appendage@body:ty``."""
    keys = [key for key in several if key not in excluded]
    return " and ".join(f"{effect}@{place}" for effect, place, _ in keys)


def _confirm_cause(cause: Key) -> str:
    """Return the experiment that confirms a cause."""
    effect, place, dof = cause
    entry = load_catalogue().get(effect) or PROVEN[effect]
    return entry.describe(entry.confirm, place, dof)


def find_best_experiment(
    campaign: Campaign, rivals: Sequence[tuple[Refit, float]]
) -> tuple[Experiment, float]:
    """Return the experiment that separates rivals best, and its gain [nats].

    Args:
        campaign: what was measured.
        rivals: refits with their probabilities.
    """
    thin = thin_lines(campaign, _EXPERIMENT_STRIDE)
    before = {refit: _measured_normal(refit) for refit, _ in rivals}
    best: tuple[Experiment, float] | None = None
    for several in list_experiments(campaign, [refit for refit, _ in rivals]):
        for experiment in several:
            gain = _expected_gain(experiment, thin, len(campaign.freq_hz), rivals, before)
            if best is None or gain > best[1]:
                best = experiment, gain
        if best is not None and best[1] > _DECISIVE_NATS:
            break
    if best is None:
        raise ValueError("a campaign without hits has no experiment")
    return best


def _expected_gain(
    experiment: Experiment,
    thin: Campaign,
    lines: int,
    rivals: Sequence[tuple[Refit, float]],
    before: Mapping[Refit, Real],
) -> float:
    """Nats that an experiment is foreseen to gain."""
    total = sum(share for _, share in rivals)
    posed = {refit: add_experiment(experiment, refit) for refit, _ in rivals}
    noise, gain = mean_channel_variance(thin), 0.0
    for true, share in rivals:
        foreseen = predict_tests(
            posed[true].model, posed[true].theta, thin, noise, experiment.inputs
        )
        for rival, weight in rivals:
            if rival is not true:
                left = _remaining_cost(
                    posed[rival], foreseen, before[rival], lines / len(thin.freq_hz)
                )
                gain += share * weight * left / total**2
    return gain


def _remaining_cost(rival: RivalModel, foreseen: Campaign, before: Real, times: float) -> float:
    """D: what a rival leaves of foreseen FRFs, tuned to them and to what was measured."""
    varies = rival.parametrisation
    problem = Misfit(rival.model, foreseen, varies, model_error_floor=rival.floor)
    x = varies.coordinates(rival.theta)
    value, gradient, normal = problem.quadratic_model(x)
    cost = (value - problem.prior(x)) * times
    slope = (gradient - np.where(varies.has_prior, x, 0.0)) * times
    whole = normal.dense() * times
    whole[: len(before), : len(before)] += before
    whole += np.diag(np.where(varies.has_prior, 1.0, FREE_PRIOR_SD**-2))
    free = np.array([name not in rival.pinned for name in varies.names])
    scale = 1 / np.sqrt(np.diag(whole)[free])
    inner = whole[np.ix_(free, free)] * np.outer(scale, scale)
    right = scale * slope[free]
    return max(float(cost - right @ np.linalg.solve(inner, right) / 2), 0.0)


def _measured_normal(rival: Refit) -> Real:
    """Normal equations of what was measured; (n_x, n_x)."""
    session = rival.session
    thin = thin_lines(session.campaign, _EXPERIMENT_STRIDE)
    problem = Misfit(session.model, thin, session.parametrisation, model_error_floor=rival.floor)
    x = session.parametrisation.coordinates(rival.fit.theta)
    times = len(session.campaign.freq_hz) / len(thin.freq_hz)
    normal: Real = problem.quadratic_model(x)[2].dense() * times
    return normal
