r"""Next experiment: it separates the leading causes, or confirms the only one.

Rivals are sets of causes with probabilities p, each fitted to what was measured. The expected gain
of an experiment is the expected log of the odds between them (Lindley 1956),

    gain = sum over i, j of p_i p_j / sum(p)^2  D_ij   [nats].

D_ij is the misfit of rival j to the FRFs that rival i predicts for the experiment, after j is tuned
to them and to all that was measured before:

    D_ij = min over dx of  |(H_i - H_j - J_j dx) / sigma|^2 + dx' (N_j + P) dx / 2
         = c - g' (N_j + P + N_new)^-1 g / 2.

N_j are the normal equations of what was measured, P those of the priors. c, g and N_new are cost,
gradient and normal equations of j against the FRFs that i predicts, with the noise of the tests of
the campaign. A new hit has tolerances of its own, which are tuned with all others.

A further hit whose FRFs are constant combinations of the measured ones measures the same again: by
linearity it adds averages and nothing else. So does a hit beside another one on a body that only
slides. It is no experiment.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from diagnosis.algorithm import Diagnosis
from diagnosis.effects import PROVEN, load_catalogue
from diagnosis.inference.calibration import load_calibration
from diagnosis.inference.evidence import Key
from diagnosis.inference.places import Keys
from diagnosis.next_test.experiments import (
    Experiment,
    RivalModel,
    add_experiment,
    list_experiments,
    propose_return,
)
from diagnosis.next_test.unexplained import list_first_mended, propose_unexplained_test
from diagnosis.refits.refit import Refit
from diagnosis.settings import DiagnosisSettings
from identification.words import Campaign, Output, Real, rounded_text
from tuning import Misfit, mean_channel_variance, predict_tests, thin_lines
from tuning.assessment.parameter_confidence import posterior_precision


def propose_experiment(diagnosis: Diagnosis) -> str | None:
    """Return the next experiment in one sentence; None if nothing is missing."""
    word, causes = diagnosis.present.word, diagnosis.posterior.causes
    if word == "none":
        return None
    if word == "unexplained" or not causes:
        proven = [f"{_confirm_cause(key)}; then " for key in list_first_mended(diagnosis)]
        return "".join(proven) + propose_unexplained_test(diagnosis)
    if (experiment := propose_return(diagnosis)) is not None:
        return experiment
    rivals = find_rivals(diagnosis)
    settings = diagnosis.settings
    if len(rivals) > 1:
        refits = [(refit, share) for _, refit, share in rivals]
        best, gain = find_best_experiment(diagnosis.session.campaign, refits, settings)
        (first, _, _), (second, _, _), *_ = rivals
        if gain > settings.twin_nats:
            pair = f"{_name_difference(first, second)} from {_name_difference(second, first)}"
            return f"{best.words}: expected to tell {pair} by {rounded_text(gain, 2)} nats"
    return _confirm_cause(causes[0][0])


def find_rivals(diagnosis: Diagnosis) -> list[tuple[Keys, Refit, float]]:
    """Return the sets of as many causes as the verdict names that are confounded with the best one.

    Returns:
        Causes, refit and probability of each set, the most probable first.
    """
    threshold = np.exp(-diagnosis.settings.twin_nats)
    count = len(diagnosis.present.causes) - len(diagnosis.gross_hypotheses)
    proven = {cause.key for cause in diagnosis.gross_hypotheses}
    rivals = []
    for keys, share in diagnosis.posterior.sets:
        added = tuple(key for key in keys if key not in proven)
        refit = diagnosis.search.refit_of(added)
        if len(added) == count and refit is not None:
            rivals.append((added, refit, share))
    return [rival for rival in rivals if rival[2] >= threshold * rivals[0][2]]


def _name_difference(causes: Keys, excluded: Keys) -> str:
    """Return the causes that are not among others in words, such as ``appendage@body:ty``."""
    keys = [key for key in causes if key not in excluded]
    return " and ".join(f"{effect}@{place}" for effect, place, _ in keys)


def _confirm_cause(cause: Key) -> str:
    """Return the experiment that confirms a cause."""
    effect, place, dof = cause
    entry = load_catalogue().get(effect) or PROVEN[effect]
    return entry.describe(entry.confirm, place, dof)


def find_best_experiment(
    campaign: Campaign, rivals: Sequence[tuple[Refit, float]], settings: DiagnosisSettings
) -> tuple[Experiment, float]:
    """Return the experiment that separates rivals best, and its expected gain [nats].

    Experiments that take less effort come first. The search ends with the first kind of which one
    is decisive: the part of its gain that the posterior counts tells confounded causes apart.

    Args:
        campaign: what was measured.
        rivals: refits with their probabilities.
        settings: thinning of the lines, and what tells causes apart.
    """
    thin = thin_lines(campaign, settings.score_stride)
    before = {refit: _compute_measured_normal(refit, settings.score_stride) for refit, _ in rivals}
    leading = min((refit for refit, _ in rivals), key=lambda refit: refit.objective)
    independent = leading.summary.count_independent(load_calibration())
    decisive_nats = settings.twin_nats * leading.summary.values / independent
    best: tuple[Experiment, float] | None = None
    for group in list_experiments(campaign, [refit for refit, _ in rivals], settings):
        for experiment in group:
            gain = _compute_gain(experiment, thin, len(campaign.freq_hz), rivals, before)
            if best is None or gain > best[1]:
                best = experiment, gain
        if best is not None and best[1] > decisive_nats:
            break
    if best is None:
        raise ValueError("a campaign without hits has no experiment")
    return best


def _compute_gain(
    experiment: Experiment,
    thin: Campaign,
    lines: int,
    rivals: Sequence[tuple[Refit, float]],
    before: Mapping[Refit, Real],
) -> float:
    """Return the expected gain of an experiment [nats]."""
    total = sum(share for _, share in rivals)
    models = {refit: add_experiment(experiment, refit) for refit, _ in rivals}
    noise, gain = mean_channel_variance(thin), 0.0
    if experiment.is_further_hit and all(
        _repeats_measured_hits(model, thin, noise, experiment) for model in models.values()
    ):
        return 0.0
    for true, share in rivals:
        predicted = predict_tests(
            models[true].model, models[true].theta, thin, noise, experiment.inputs
        )
        for rival, weight in rivals:
            if rival is not true:
                ratio = lines / len(thin.freq_hz)
                misfit = _compute_misfit(models[rival], predicted, before[rival], ratio)
                gain += share * weight * misfit / total**2
    return gain


def _repeats_measured_hits(
    rival: RivalModel, thin: Campaign, noise: Mapping[Output, Real], experiment: Experiment
) -> bool:
    """Return whether the FRFs of new hits are constant combinations of those that were measured.

    The coefficients are real, the same on all lines and channels; what they leave is compared with
    the noise.

    Args:
        rival: model of a rival.
        thin: what was measured.
        noise: variance of each channel.
        experiment: new hits.
    """
    new, measured = (
        predict_tests(rival.model, rival.theta, thin, noise, inputs).tests
        for inputs in (experiment.inputs, thin.inputs)
    )
    columns = np.stack([test.estimate.frf.values.ravel() for test in measured], axis=1)
    for test in new:
        variance = np.maximum(test.estimate.variance.ravel(), np.finfo(float).tiny)
        weight = 1 / np.sqrt(variance)
        basis, values = columns * weight[:, None], test.estimate.frf.values.ravel() * weight
        parts = np.concatenate([basis.real, basis.imag]), np.concatenate([values.real, values.imag])
        coefficients = np.linalg.lstsq(*parts, rcond=None)[0]
        if ((parts[1] - parts[0] @ coefficients) ** 2).sum() > len(values):
            return False
    return True


def _compute_misfit(rival: RivalModel, predicted: Campaign, before: Real, ratio: float) -> float:
    """Return D, the misfit of a rival to predicted FRFs after it is tuned to them.

    Args:
        rival: model of the rival.
        predicted: FRFs that another rival predicts.
        before: normal equations of what was measured; (n_x, n_x).
        ratio: number of all lines per line of ``predicted``.
    """
    varies = rival.parametrisation
    problem = Misfit(rival.model, predicted, varies, model_error_floor=rival.floor)
    x = varies.coordinates(rival.theta)
    value, gradient, normal = problem.quadratic_model(x)
    cost = (value - problem.prior(x)) * ratio
    slope = (gradient - varies.precision * x) * ratio
    whole = normal.dense() * ratio
    whole[: len(before), : len(before)] += before
    whole += np.diag(posterior_precision(varies, x))
    free = np.array([name not in rival.pinned for name in varies.names])
    scale = 1 / np.sqrt(np.diag(whole)[free])
    inner = whole[np.ix_(free, free)] * np.outer(scale, scale)
    right = scale * slope[free]
    return max(float(cost - right @ np.linalg.solve(inner, right) / 2), 0.0)


def _compute_measured_normal(rival: Refit, stride: int) -> Real:
    """Return the normal equations of what was measured; (n_x, n_x)."""
    session = rival.session
    thin = thin_lines(session.campaign, stride)
    problem = Misfit(session.model, thin, session.parametrisation, model_error_floor=rival.floor)
    x = session.parametrisation.coordinates(rival.fit.theta)
    ratio = len(session.campaign.freq_hz) / len(thin.freq_hz)
    return problem.quadratic_model(x)[2].dense() * ratio
