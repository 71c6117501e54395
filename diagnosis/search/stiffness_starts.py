"""Gains and starts of hypotheses in dynamic stiffness, against the state before a change.

A change of 10 % moves narrow modes by many bandwidths, so that FRFs are far from linear in it: both
sets of peaks show, and a fit that begins without the change ends in a wrong minimum. In dynamic
stiffness most effects are linear (``tuning.misfit.stiffness_misfit``). Each hypothesis is fitted by
a few steps of Gauss and Newton, with the common drift of all stiffness beside it. What it gains
ranks it, and where it ends a refit begins.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.refits.refit import Refit, map_values
from diagnosis.refits.refitting import add_hypotheses, find_start
from diagnosis.search.linearised_fit import Gained, find_signed, maximise_gain
from diagnosis.search.score_test import Score, extend_model, rank_scores
from identification.words import Campaign, Real
from tuning import Session, thin_lines
from tuning.misfit.stiffness_misfit import StiffnessMisfit

_MIN_GAIN = 1e-3  # relative decrease of the cost below which the steps end


def has_square_matrix(campaign: Campaign) -> bool:
    """Return whether the tests are one square matrix of FRFs, each reference hit once."""
    count = len(campaign.outputs)
    return (
        len(campaign.inputs) == len(campaign.tests) == count
        and all(test.estimate.measured.all() for test in campaign.tests)
        and all(len(test.estimate.frf.outputs) == count for test in campaign.tests)
    )


def rank_by_stiffness(
    scene: Scene, base: Refit, hypotheses: Sequence[Hypothesis], stride: int
) -> list[Score]:
    """Return the scores of hypotheses by their fits in dynamic stiffness, the largest gain first.

    Each hypothesis begins where its fit ends.

    Args:
        scene: campaign and model of the refit.
        base: refit about which they are proposed, in the state after a change.
        stride: every ``stride``-th line counts.
    """
    thin = stride * scene.stride_factor
    steps = scene.settings.schedule.max_steps  # linear effects take two, resonators some more
    null = _fit(scene.session, base.fit.theta, (), thin, steps)
    ranked = rank_scores(hypotheses, _find_linear_gains(scene, base, hypotheses, thin))
    best: dict[str, list[Score]] = {}
    for score in ranked:
        best.setdefault(score.hypothesis.site, []).append(score)
    # Those fitted to the end: some shapes of each effect and place, twice the refits of a round,
    # and what has further starts, as a spring whose change is far from linear below a motor.
    leading = [
        score.hypothesis
        for number, of_site in enumerate(best.values())
        for score in of_site[: scene.settings.max_variants]
        if number < 2 * scene.settings.max_refits or score.hypothesis.otherwise
    ]
    ends = [_fit_hypothesis(base, hypothesis, thin, steps) for hypothesis in leading]
    fitted = set(map(id, leading))
    further = [score for score in ranked if id(score.hypothesis) not in fitted]
    return [*_rank(leading, ends, null), *further]


def _find_linear_gains(
    scene: Scene, base: Refit, hypotheses: Sequence[Hypothesis], stride: int
) -> list[Gained]:
    """Return the gain of one step of each hypothesis, of all those that add to Z at once.

    Corrected data, and hypotheses whose slope tells little, need evaluations of their own.
    """
    together = [
        hypothesis
        for hypothesis in hypotheses
        if not hypothesis.correct and not hypothesis.reform and hypothesis.is_slope_informative
    ]
    model, whole, x = extend_model(scene, base.fit, together)
    wanted = {name for hypothesis in together for name in hypothesis.coordinates}
    is_wanted = np.isin(np.array(whole.names), list(wanted))
    session = replace(scene.session, model=model, parametrisation=whole)
    problem = StiffnessMisfit.build(
        model, thin_lines(session.campaign, stride), whole.restrict(is_wanted, x)
    )
    cost, residual, jacobian = problem.linearise(x[is_wanted])
    place = {name: k for k, name in enumerate(problem.varies.names)}
    gained: dict[int, Gained] = {}
    for hypothesis in together:
        columns = jacobian[:, [place[name] for name in hypothesis.coordinates]]
        gained[id(hypothesis)] = maximise_gain(
            (columns.conj().T @ columns).real,
            (columns.conj().T @ residual).real,
            find_signed(hypothesis),
        )
    for hypothesis in hypotheses:
        if id(hypothesis) not in gained:
            end = _fit_hypothesis(base, hypothesis, stride, 1)
            step = np.array([end.x.get(name, 0.0) for name in hypothesis.coordinates])
            gained[id(hypothesis)] = max(cost - end.cost, 0.0), step
    return [gained[id(hypothesis)] for hypothesis in hypotheses]


def _rank(hypotheses: Sequence[Hypothesis], ends: Sequence["_End"], null: "_End") -> list[Score]:
    """Return the scores of hypotheses that begin where their fits ended."""
    gained = [
        (
            max(null.cost - end.cost, 0.0),
            np.array([end.x.get(name, 0.0) for name in hypothesis.coordinates]),
        )
        for hypothesis, end in zip(hypotheses, ends, strict=True)
    ]
    begun = {
        id(hypothesis): replace(hypothesis, begin={**hypothesis.begin, **end.begin})
        for hypothesis, end in zip(hypotheses, ends, strict=True)
    }
    return [
        replace(score, hypothesis=begun[id(score.hypothesis)])
        for score in rank_scores(hypotheses, gained)
    ]


def _fit_hypothesis(base: Refit, hypothesis: Hypothesis, stride: int, steps: int) -> "_End":
    """Return the best end of fits with a hypothesis, from its start and its alternative ones."""
    session = add_hypotheses(base.session, hypothesis)
    added = {p.name for part in hypothesis.parts for p in part.parameters}
    names = (*hypothesis.release, *(added - {*hypothesis.follow, *hypothesis.held}))
    ends = []
    for start in ({}, *hypothesis.otherwise):
        begun = replace(hypothesis, begin={**hypothesis.begin, **start})
        ends.append(_fit(session, find_start(base, session, begun), names, stride, steps))
    return min(ends, key=lambda end: end.cost)


@dataclass(frozen=True, eq=False)
class _End:
    """End of a fit.

    Args:
        begin: parameters that varied [SI], by name.
        x: coordinates, by name.
        cost: half the weighted sum of squares, and the priors [nats].
    """

    begin: Mapping[str, float]
    x: Mapping[str, float]
    cost: float


def _fit(
    session: Session,
    start: Real,
    names: Sequence[str],
    stride: int,
    steps: int,
) -> _End:
    """Fit some coordinates and the drift of all stiffness in dynamic stiffness.

    Args:
        session: model with the hypothesis, campaign corrected for it.
        start: parameters at the start [SI]; (n_parameter,).
        names: coordinates that vary.
        steps: Gauss-Newton steps at most.
    """
    whole = session.parametrisation
    drifts = {p.name for p in whole.parameters if p.known in ("stiffness", "damping")}
    kept = np.isin(np.array(whole.names), [*names, *drifts])
    x_whole = np.clip(whole.coordinates(start), whole.lower, whole.upper)
    varies, x = whole.restrict(kept, x_whole), x_whole[kept]
    problem = StiffnessMisfit.build(session.model, thin_lines(session.campaign, stride), varies)
    cost, gradient, normal = problem.expand(x)
    for _ in range(steps):
        if not len(x):
            break
        trial = problem.step(x, cost, gradient, normal)
        if trial is None:
            break
        x, (new_cost, gradient, normal) = trial
        is_small = cost - new_cost < _MIN_GAIN * max(cost, 1.0)
        cost = new_cost
        if is_small:
            break
    x_whole[kept] = x
    values = map_values(whole, varies.theta(x))
    return _End(
        {name: values[name] for name in names},
        dict(zip(whole.names, x_whole.tolist(), strict=True)),
        cost,
    )
